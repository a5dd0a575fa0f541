use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};

/// Thresholds of the comparison of logged and commanded torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct TorqueCheckSettings {
    /// Largest deviation of a joint's torque scale from one, percent. Default 3: correct logs of the robots in the
    /// tests deviate by at most 1.5.
    pub scale_percent: f64,
    /// Largest root mean square of the difference between logged and commanded torque, in percent of the joint's
    /// torque. Default 5: correct logs of the robots in the tests have at most 2.
    pub difference_percent: f64,
    /// Largest deviation of a joint's torque scale from that of the other joints, percent; it follows from the
    /// parameters on which the torques of several joints depend. Default 5.
    pub row_scale_percent: f64,
    /// Largest deviation of the log's clock from the controller's, percent. Default 0.1.
    pub clock_percent: f64,
    /// Number of standard deviations that a deviation must also exceed. Default 4.
    pub sigmas: f64,
    /// Thresholds for reporting the cause of a difference. Not part of study files.
    #[serde(skip)]
    pub causes: CauseSettings,
}

/// Thresholds for the cause of a difference between logged and commanded torque.
#[derive(Clone, Debug, PartialEq)]
pub struct CauseSettings {
    /// Minimum share of the squared difference that a cause common to all joints must explain, 0 to 1. Default 0.85.
    pub min_explained_share: f64,
    /// Minimum ratio of the squared residuals of the second-best and the best common cause. Default 2.
    pub min_residual_ratio: f64,
    /// Minimum share that the cause for a single joint must explain, 0 to 1. Default 0.95.
    pub min_explained_share_alone: f64,
    /// Minimum ratio of the squared residuals of any other and the best cause for a single joint. Default 4.
    pub min_residual_ratio_alone: f64,
}

impl Default for CauseSettings {
    fn default() -> Self {
        Self {
            min_explained_share: 0.85,
            min_residual_ratio: 2.0,
            min_explained_share_alone: 0.95,
            min_residual_ratio_alone: 4.0,
        }
    }
}

impl Default for TorqueCheckSettings {
    fn default() -> Self {
        Self {
            scale_percent: 3.0,
            difference_percent: 5.0,
            row_scale_percent: 5.0,
            clock_percent: 0.1,
            sigmas: 4.0,
            causes: CauseSettings::default(),
        }
    }
}

impl TorqueCheckSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Numbers that are negative or not finite.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let settings = [
            ("torque_check.scale_percent", self.scale_percent),
            ("torque_check.difference_percent", self.difference_percent),
            ("torque_check.row_scale_percent", self.row_scale_percent),
            ("torque_check.clock_percent", self.clock_percent),
            ("torque_check.sigmas", self.sigmas),
            ("torque_check.causes.min_explained_share", self.causes.min_explained_share),
            ("torque_check.causes.min_residual_ratio", self.causes.min_residual_ratio),
            ("torque_check.causes.min_explained_share_alone", self.causes.min_explained_share_alone),
            ("torque_check.causes.min_residual_ratio_alone", self.causes.min_residual_ratio_alone),
        ];
        settings.into_iter().try_for_each(|(name, value)| {
            require((0.0..=1e6).contains(&value), name, value, "give zero or a positive number")
        })
    }
}
