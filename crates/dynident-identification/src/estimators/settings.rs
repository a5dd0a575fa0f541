//! Settings of the estimation: estimator and error bars.

use super::{Estimator, InstrumentSettings};
use crate::thresholds::EstimationThresholds;
use dynident_estimation::{
    CovarianceMethod, EssentialSettings, OrdinarySettings, RankSettings, SegmentSettings, WeightedSettings,
};

/// Estimator of base parameters, and their error bars.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct EstimationSettings {
    /// Estimator; weighted least squares by default.
    pub estimator: Estimator,
    /// Criterion for excited columns.
    pub rank: RankSettings,
    /// Method for the covariance of the error bars; jackknife by default.
    pub covariance: CovarianceMethod,
    /// Segments of logs for the covariance.
    pub segments: SegmentSettings,
    /// Instruments that only test whether noise in the regressor biases the estimator; none by default.
    pub exogeneity_test: Option<InstrumentSettings>,
    /// Whether noise in the regressor is tested if possible, with instruments from the logs' own motion. It takes one
    /// more pass over the logs; off by default. [`Estimator::Auto`] always does it.
    pub examine_exogeneity: bool,
    /// Holds poorly determined parameters at zero; off by default.
    pub essential: Option<EssentialSettings>,
    /// Base columns held at given values (column, value); none by default.
    pub held: Vec<(usize, f64)>,
    /// Thresholds of tests.
    pub thresholds: EstimationThresholds,
}

impl EstimationSettings {
    /// An estimator with default settings otherwise.
    pub fn of(estimator: Estimator) -> Self {
        Self { estimator, ..Self::default() }
    }

    pub(crate) fn weighted(&self) -> WeightedSettings {
        WeightedSettings { rank: self.rank, covariance: self.covariance, ..WeightedSettings::default() }
    }

    pub(crate) fn ordinary(&self) -> OrdinarySettings {
        OrdinarySettings { rank: self.rank, covariance: self.covariance }
    }
}
