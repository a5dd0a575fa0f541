//! How a model is identified: filters, estimator, what is known of the bodies, whose friction is chosen.

use crate::consistent::ConsistencySettings;
use crate::error::IdentificationError;
use crate::estimators::{Estimator, InstrumentSettings};
use crate::friction::FrictionSearch;
use crate::rows::ParallelFilterSettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::{
    CovarianceMethod, EssentialSettings, OrdinarySettings, RankSettings, SegmentSettings, WeightedSettings,
};
use dynident_recording::MotionSettings;
use serde::{Deserialize, Serialize};

/// Whether logs share the constant torques of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum OffsetChoice {
    /// One offset for each joint.
    #[default]
    Shared,
    /// Each training log has its own; base parameters and joints hold their mean. Zeros of torque sensors drift from
    /// day to day.
    PerLog,
}

/// Who says what a unit of logged torque is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum GainChoice {
    /// The format: torque columns are newton metres once their units and scales are in force.
    #[default]
    Stated,
    /// The logs: joint by joint one gain, from logs without and with a payload that is known.
    Unknown,
}

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

/// Everything that [`identify`](crate::identify()) can be given beside robot and recordings; the default is weighted
/// least squares with consistent parameters.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct IdentificationSettings {
    /// From positions to velocities and accelerations.
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    pub parallel_filter: ParallelFilterSettings,
    /// The estimator.
    pub estimation: EstimationSettings,
    /// What is known of the bodies; `None` leaves parameters as they are estimated, consistent or not.
    pub consistency: Option<ConsistencySettings>,
    /// Intervals for every parameter over all consistent sets that the data do not reject; some thousand fits, so not
    /// by default.
    pub intervals: bool,
    /// Joints whose friction the training logs choose; none by default.
    pub friction: Vec<FrictionSearch>,
    /// Whether training logs share their offsets; by default they do.
    pub offsets: OffsetChoice,
    /// Whether torque is in newton metres; by default it is.
    pub gains: GainChoice,
}

impl Default for IdentificationSettings {
    fn default() -> Self {
        Self {
            motion: MotionSettings::default(),
            parallel_filter: ParallelFilterSettings::default(),
            estimation: EstimationSettings::default(),
            consistency: Some(ConsistencySettings::default()),
            intervals: false,
            friction: Vec::new(),
            offsets: OffsetChoice::default(),
            gains: GainChoice::default(),
        }
    }
}

impl IdentificationSettings {
    /// Checks that the bodies and terms of which something is known are there.
    ///
    /// # Errors
    /// A name that the robot does not have.
    pub fn check_names(&self, robot: &ParametricModel) -> Result<(), IdentificationError> {
        let Some(knowledge) = &self.consistency else { return Ok(()) };
        let mut named = knowledge.clone();
        if !self.friction.is_empty() {
            // Terms that the logs are to choose are not there yet.
            named.terms.clear();
        }
        named.check_names(robot.model(), robot.terms()).map_err(IdentificationError::Consistency)
    }
}
