//! Settings of the fits of each joint and of their usual residuals.

use super::Rule;
use serde::{Deserialize, Serialize};

/// Averages over time, and the model of each joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BinSettings {
    /// Length of a bin, s. 0.04 by default. The start and end of an event are accurate to about two bins.
    pub bin_s: f64,
    /// Minimum number of bins for each parameter of a joint's model; shorter logs are not searched. 3 by default.
    pub min_bins_per_parameter: usize,
    /// Velocity scale of the narrow friction function, relative to the root mean square velocity of the joint. 0.03 by
    /// default.
    pub narrow_step_ratio: f64,
    /// Ratio of the velocity scales of the wide and the narrow friction function. 6.0 by default.
    pub wide_step_ratio: f64,
    /// Distance after a reversal that reverses the presliding friction from zero, relative to the distance that the
    /// joint moves in one bin at its root mean square velocity. 0.05 by default.
    pub presliding_ratio: f64,
    /// Velocity below which a joint is at rest, relative to its root mean square velocity. 0.1 by default.
    pub rest_ratio: f64,
}

impl Default for BinSettings {
    fn default() -> Self {
        Self {
            bin_s: 0.04,
            min_bins_per_parameter: 3,
            narrow_step_ratio: 0.03,
            wide_step_ratio: 6.0,
            presliding_ratio: 0.05,
            rest_ratio: 0.1,
        }
    }
}

impl BinSettings {
    pub(super) fn rules(&self) -> [Rule; 6] {
        [
            ("bins.bin_s", self.bin_s, 1e-6, 1e3),
            ("bins.min_bins_per_parameter", self.min_bins_per_parameter as f64, 1.0, 1e6),
            ("bins.narrow_step_ratio", self.narrow_step_ratio, 1e-6, 1.0),
            ("bins.wide_step_ratio", self.wide_step_ratio, 1.0, 1e6),
            ("bins.presliding_ratio", self.presliding_ratio, 1e-6, 1e3),
            ("bins.rest_ratio", self.rest_ratio, 0.0, 1.0),
        ]
    }
}

/// The first fit, which excludes the least consistent blocks of the log.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct RobustFitSettings {
    /// Length of a block, s. 0.4 by default. Blocks are longer if there would be more than 100.
    pub block_s: f64,
    /// Share of the blocks that the robust fit uses. 0.6 by default: events may last 40 % of the log.
    pub kept_share: f64,
    /// Limit on a block's squared error relative to the median block, so that one joint alone does not decide whether
    /// the block is used. 50.0 by default.
    pub max_block_error: f64,
}

impl Default for RobustFitSettings {
    fn default() -> Self {
        Self { block_s: 0.4, kept_share: 0.6, max_block_error: 50.0 }
    }
}

impl RobustFitSettings {
    pub(super) fn rules(&self) -> [Rule; 3] {
        [
            ("robust_fit.block_s", self.block_s, 1e-6, 1e4),
            ("robust_fit.kept_share", self.kept_share, 0.5, 1.0),
            ("robust_fit.max_block_error", self.max_block_error, 1.0, 1e6),
        ]
    }
}

/// The usual residual of a joint in each state of motion.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct UsualResidualSettings {
    /// Velocity below which a joint is treated as reversing or resting, relative to its root mean square velocity. 0.15
    /// by default.
    pub reversal_ratio: f64,
    /// Number of bins before and after a reversal that are treated as part of it. 3 by default.
    pub reversal_bins: usize,
    /// Share of the dry friction that may remain unexplained near reversal and at rest, where friction is not
    /// determined. 0.5 by default.
    pub friction_share: f64,
    /// Assumed friction in proportion to the torque of the joint; the model does not contain such friction. 0.08 by
    /// default.
    pub load_friction: f64,
    /// Assumed time difference between motion and torque after their filters, s. 0.01 by default.
    pub time_error_s: f64,
    /// Smallest residual variance for one state of motion, relative to the variance over all bins. 0.5 by default.
    pub min_variance_ratio: f64,
    /// Smallest usual residual relative to the joint's torque (both root mean square): model error that remains even
    /// with a perfect sensor. 0.002 by default.
    pub min_model_error: f64,
}

impl Default for UsualResidualSettings {
    fn default() -> Self {
        Self {
            reversal_ratio: 0.15,
            reversal_bins: 3,
            friction_share: 0.5,
            load_friction: 0.08,
            time_error_s: 0.01,
            min_variance_ratio: 0.5,
            min_model_error: 0.002,
        }
    }
}

impl UsualResidualSettings {
    pub(super) fn rules(&self) -> [Rule; 7] {
        [
            ("usual_residual.reversal_ratio", self.reversal_ratio, 0.0, 1.0),
            ("usual_residual.reversal_bins", self.reversal_bins as f64, 0.0, 1e6),
            ("usual_residual.friction_share", self.friction_share, 0.0, 10.0),
            ("usual_residual.load_friction", self.load_friction, 0.0, 1.0),
            ("usual_residual.time_error_s", self.time_error_s, 0.0, 10.0),
            ("usual_residual.min_variance_ratio", self.min_variance_ratio, 0.0, 1.0),
            ("usual_residual.min_model_error", self.min_model_error, 0.0, 1.0),
        ]
    }
}
