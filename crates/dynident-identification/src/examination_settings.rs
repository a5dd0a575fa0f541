//! Limits of the examination of an estimate.

use crate::limits::{InvalidLimit, check_limits};
use serde::{Deserialize, Serialize};

/// Limits of the examination of an estimate, which decide about its findings.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ExaminationSettings {
    /// Largest ratio of the residual with the opposite torque sign to the residual with the sign as logged, for the
    /// sign to be reported as reversed. Default 0.5.
    pub max_reversed_ratio: f64,
    /// Residual with the bodies of the robot description, percent of the torque, above which the description may be of
    /// another robot. Default 50. The residual contains the friction, which is usually less.
    pub max_nominal_residual_percent: f64,
    /// Size of negative friction divided by its standard deviation, above which a joint is reported as reversed.
    /// Default 5. On the first real logs, the estimates for correct joints were above −2.5 standard deviations, for
    /// dead channels below −8.
    pub min_friction_deviations: f64,
    /// Size of negative friction relative to the residual of the joint (root mean squares), above which a joint is
    /// reported as reversed. Default 0.5. Smaller values may result from an unmodelled effect, for example for a wrist
    /// whose torque is measured after the gear and is mostly noise.
    pub min_friction_ratio: f64,
    /// Ratio of a higher differentiator cut-off to that of the fit. Default 4. The difference between the torques
    /// predicted with both shows the error that motion above the cut-off of the fit causes.
    pub finer_cutoff_ratio: f64,
    /// Share of a held-out log, from its start, that determines its torque offsets if each log has separate offsets,
    /// from 0 to 1. Default 0.25. With the usual length of a log, the offset is then more accurate than the other
    /// parameters, and most of the log remains for the test.
    pub offset_share: f64,
    /// Unexplained torque of a joint with a function of its position, divided by that without it, below which a spring
    /// or counterbalance is reported. Default 0.6. Both fits contain all parameters of the joint and all friction laws,
    /// so the ratio is close to 1 without such a torque.
    pub max_left_by_position: f64,
    /// Minimum torque that only the function of the position explains, relative to the torque of the joint (root mean
    /// squares). Default 0.02. A smaller function hardly improves the prediction.
    pub min_position_ratio: f64,
}

impl Default for ExaminationSettings {
    fn default() -> Self {
        Self {
            max_reversed_ratio: 0.5,
            max_nominal_residual_percent: 50.0,
            min_friction_deviations: 5.0,
            min_friction_ratio: 0.5,
            finer_cutoff_ratio: 4.0,
            offset_share: 0.25,
            max_left_by_position: 0.6,
            min_position_ratio: 0.02,
        }
    }
}

impl ExaminationSettings {
    /// Checks that all limits are finite and positive.
    ///
    /// # Errors
    /// The first invalid limit.
    pub fn validate(&self) -> Result<(), InvalidLimit> {
        check_limits(&[
            ("max_reversed_ratio", self.max_reversed_ratio),
            ("max_nominal_residual_percent", self.max_nominal_residual_percent),
            ("min_friction_deviations", self.min_friction_deviations),
            ("min_friction_ratio", self.min_friction_ratio),
            ("finer_cutoff_ratio", self.finer_cutoff_ratio),
            ("offset_share", self.offset_share),
            ("max_left_by_position", self.max_left_by_position),
            ("min_position_ratio", self.min_position_ratio),
        ])
    }
}
