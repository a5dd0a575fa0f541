//! From rows to base parameters: the estimator chosen, and how far what it gives is trusted.

use super::{Estimator, InstrumentSettings};
use dynident_estimation::{
    CovarianceMethod, EssentialSettings, OrdinarySettings, RankSettings, SegmentSettings, WeightedSettings,
};

/// From rows to base parameters, and how far these are trusted.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct EstimationSettings {
    /// The estimator; weighted least squares by default.
    pub estimator: Estimator,
    /// When a column counts as excited.
    pub rank: RankSettings,
    /// The covariance that error bars come from; jackknife by default.
    pub covariance: CovarianceMethod,
    /// How logs are cut into segments for the covariance.
    pub segments: SegmentSettings,
    /// Instruments that only test whether noise in the regressor biases the estimator; none by default.
    pub exogeneity_test: Option<InstrumentSettings>,
    /// Whether noise in the regressor is looked for where that is possible, with instruments of the logs' own motion;
    /// one more pass over the logs, and not by default. [`Estimator::Auto`] does so in any case.
    pub examine_exogeneity: bool,
    /// Hold parameters that the data hardly determine at zero; not by default.
    pub essential: Option<EssentialSettings>,
    /// Base columns that are held at given values (place among the base columns, value); none by default.
    pub held: Vec<(usize, f64)>,
}

impl EstimationSettings {
    /// An estimator with the defaults of all else.
    pub fn of(estimator: Estimator) -> Self {
        Self { estimator, ..Self::default() }
    }

    /// Settings of weighted least squares with this rank rule and covariance.
    pub(crate) fn weighted(&self) -> WeightedSettings {
        WeightedSettings { rank: self.rank, covariance: self.covariance, ..WeightedSettings::default() }
    }

    /// Settings of ordinary least squares with this rank rule and covariance.
    pub(crate) fn ordinary(&self) -> OrdinarySettings {
        OrdinarySettings { rank: self.rank, covariance: self.covariance }
    }
}
