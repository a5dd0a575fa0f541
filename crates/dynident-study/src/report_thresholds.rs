//! `[thresholds]`: when results are rated as good, as doubtful or as certain.

use crate::error::{Expected, StudyError};
use serde::{Deserialize, Serialize};

/// Thresholds of statements about torque errors. All errors are relative to the measured torque (root mean squares).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct TorqueErrorSettings {
    /// Largest held-out error that is rated as good, percent. Default 10: real arms with a correct study have 2 to 10.
    pub max_good_percent: f64,
    /// Largest held-out error that is not rated as bad, percent. Default 60, like
    /// [`ProblemSettings::max_unexplained_percent`].
    pub max_fair_percent: f64,
    /// Smallest error of a joint that is reported as much worse than the robot, percent. Default 20.
    pub min_joint_percent: f64,
    /// Error of a joint divided by that of all joints together, from which the joint is reported as much worse.
    /// Default 2.
    pub min_joint_ratio: f64,
    /// Torque of a joint divided by the largest torque of a joint with the same unit (root mean squares), up to which
    /// the torque is reported as small. Default 0.1.
    pub max_small_torque_ratio: f64,
    /// Error of an export format divided by that of the model, from which the format is reported as worse. Default 1.2.
    pub min_form_ratio: f64,
    /// Residual at reversals divided by that of fast motion, from which a likely cause is named. Default 2. In 128
    /// simulated studies with the right friction law (`benchmarks/changes.py`) the ratio was 0.5 to 1.5, in one with
    /// joints that stick at each reversal 2.2.
    pub min_reversal_ratio: f64,
}

impl Default for TorqueErrorSettings {
    fn default() -> Self {
        Self {
            max_good_percent: 10.0,
            max_fair_percent: 60.0,
            min_joint_percent: 20.0,
            min_joint_ratio: 2.0,
            max_small_torque_ratio: 0.1,
            min_form_ratio: 1.2,
            min_reversal_ratio: 2.0,
        }
    }
}

impl TorqueErrorSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is not a positive number, with its value.
    pub fn validate(&self) -> Result<(), StudyError> {
        for (key, value) in [
            ("max_good_percent", self.max_good_percent),
            ("max_fair_percent", self.max_fair_percent),
            ("min_joint_percent", self.min_joint_percent),
            ("min_joint_ratio", self.min_joint_ratio),
            ("max_small_torque_ratio", self.max_small_torque_ratio),
            ("min_form_ratio", self.min_form_ratio),
            ("min_reversal_ratio", self.min_reversal_ratio),
        ] {
            Expected::Positive.check(key, value)?;
        }
        Ok(())
    }
}

/// Thresholds of the problems that a result lists as reasons against loading its model into a robot.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ProblemSettings {
    /// Torque error of the physically consistent model divided by that of the unconstrained estimate (same rows, all
    /// joints together). A larger ratio is a problem. Default 1.5: real test logs have 0.8 to 1.14, logs with a dead
    /// torque channel 1.6.
    pub max_error_ratio: f64,
    /// Torque error of the physically consistent model divided by that of the unconstrained estimate, for a single
    /// joint. A larger ratio is a problem. Default 2.5: real test logs have 0.6 to 1.7, logs with a dead torque channel
    /// 5.2.
    pub max_joint_error_ratio: f64,
    /// Unexplained torque of training or held-out logs, percent of the torque. A larger value is a problem. Default 60.
    pub max_unexplained_percent: f64,
    /// Residual of a held-out log divided by that of the training logs (root mean square over the joints). A larger
    /// ratio is a problem. Default 4: ten real data sets have 0.9 to 2.4, a fit of 58 parameters to 3 s has 6.
    pub max_held_out_ratio: f64,
    /// Limit of the residual ratio in `max_held_out_ratio` if `check` found a joint torque that no physically
    /// consistent model explains. Default 2.
    pub max_held_out_ratio_if_inconsistent: f64,
    /// Unexplained torque of a log or joint, percent. Below it no ratio of errors is a problem. Default 1: the torques
    /// of good drives are accurate to about 1 %, and a gripper with constant torque is explained to 0.001 %.
    pub min_held_out_percent: f64,
    /// Range of the positions, rad (m): if every joint's range in all training logs is smaller, the robot is treated as
    /// at rest. Default 0.01: motions of the examples with real logs have ranges above 0.3.
    pub max_range_at_rest: f64,
    /// Smallest torque of a joint for the comparison of errors, relative to the largest joint torque. Default 1e-3:
    /// smaller torques are friction only.
    pub min_torque_share: f64,
}

impl Default for ProblemSettings {
    fn default() -> Self {
        Self {
            max_error_ratio: 1.5,
            max_joint_error_ratio: 2.5,
            max_unexplained_percent: 60.0,
            max_held_out_ratio: 4.0,
            max_held_out_ratio_if_inconsistent: 2.0,
            min_held_out_percent: 1.0,
            max_range_at_rest: 0.01,
            min_torque_share: 1.0e-3,
        }
    }
}

impl ProblemSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is not a positive number, with its value.
    pub fn validate(&self) -> Result<(), StudyError> {
        for (key, value) in [
            ("max_error_ratio", self.max_error_ratio),
            ("max_joint_error_ratio", self.max_joint_error_ratio),
            ("max_unexplained_percent", self.max_unexplained_percent),
            ("max_held_out_ratio", self.max_held_out_ratio),
            ("max_held_out_ratio_if_inconsistent", self.max_held_out_ratio_if_inconsistent),
            ("min_held_out_percent", self.min_held_out_percent),
            ("max_range_at_rest", self.max_range_at_rest),
            ("min_torque_share", self.min_torque_share),
        ] {
            Expected::Positive.check(key, value)?;
        }
        Ok(())
    }
}

/// Thresholds of statements about bodies that differ from the robot description.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct DifferenceSettings {
    /// Minimum probability with which an explanation by single bodies is reported as a possibility. Default 0.5.
    pub min_reported_probability: f64,
    /// Minimum probability with which it is reported as a fact, with the edit test. Default 0.95: with 79 %, a body was
    /// named in a study in which all bodies differ.
    pub min_certain_probability: f64,
    /// Minimum probability with which an alternative explanation is listed in text. Default 0.1.
    pub min_alternative_probability: f64,
}

impl Default for DifferenceSettings {
    fn default() -> Self {
        Self { min_reported_probability: 0.5, min_certain_probability: 0.95, min_alternative_probability: 0.1 }
    }
}

impl DifferenceSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first setting that is not a probability, with its value.
    pub fn validate(&self) -> Result<(), StudyError> {
        for (key, value) in [
            ("min_reported_probability", self.min_reported_probability),
            ("min_certain_probability", self.min_certain_probability),
            ("min_alternative_probability", self.min_alternative_probability),
        ] {
            Expected::Positive.check(key, value)?;
        }
        Ok(())
    }
}
