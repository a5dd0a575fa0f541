//! Settings of the estimation: estimator and error bars.

use super::{Estimator, InstrumentSettings};
use crate::thresholds::EstimationThresholds;
use dynident_estimation::{
    CovarianceMethod, EssentialSettings, OrdinarySettings, RankSettings, SegmentSettings, WeightedSettings,
};

/// Settings: estimator of base parameters, and method of its error bars.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct EstimationSettings {
    /// Estimator; weighted least squares by default.
    pub estimator: Estimator,
    /// Criterion that decides which regressor columns are excited.
    pub rank: RankSettings,
    /// Method for the covariance behind the error bars; jackknife by default.
    pub covariance: CovarianceMethod,
    /// Division of the logs into time segments, for the covariance.
    pub segments: SegmentSettings,
    /// Instruments that are only used to test whether noise in the regressor biases the estimator; none by default.
    pub exogeneity_test: Option<InstrumentSettings>,
    /// Whether to test the effect of noise in the regressor, if possible, with instruments from the logs' own motion.
    /// The test takes one more pass over the logs; off by default. [`Estimator::Auto`] always makes it.
    pub examine_exogeneity: bool,
    /// Settings for fixing poorly determined parameters at zero; off by default.
    pub essential: Option<EssentialSettings>,
    /// Base parameters that are fixed at given values (column, value); none by default.
    pub held: Vec<(usize, f64)>,
    /// Thresholds of tests.
    pub thresholds: EstimationThresholds,
}

impl EstimationSettings {
    /// Settings with this estimator and defaults otherwise.
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
