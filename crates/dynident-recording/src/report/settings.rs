//! Limits above which findings about a log are reported.

use crate::error::{FilterError, require};

/// Limits above which a finding is reported. They are not part of a study file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportSettings {
    /// Maximum share of rejected samples that is reported as information; a larger share is a warning. 0.005 by
    /// default.
    pub max_info_share: f64,
    /// Minimum ratio of the steps before and after an isolated sample to the largest step nearby, 20 by default.
    pub isolated_step_ratio: f64,
    /// Minimum deviation of an isolated sample, as a share of the range of all other samples, 0.25 by default.
    pub isolated_range_share: f64,
    /// Minimum ratio of a position jump to the largest step of the motion, 5 by default.
    pub jump_step_ratio: f64,
    /// Minimum size of a position jump, as a share of the channel's range, 0.01 by default. (The position of an encoder
    /// at rest changes by single counts.)
    pub jump_range_share: f64,
    /// Correlation of a logged velocity with the derivative of the position, above which the two are treated as
    /// proportional, 0.98 by default.
    pub proportional_correlation: f64,
    /// Minimum logarithm of the ratio of a logged velocity to the derivative of the position with which another unit or
    /// sample rate is reported, 0.05 by default.
    pub min_log_factor: f64,
    /// Maximum relative difference of the ratio of a logged velocity to the derivative of the position from the factor
    /// of a unit, for the unit to be named, 0.02 by default.
    pub unit_tolerance: f64,
    /// Correlation of a logged derivative with the derivative of the position below which the signs are reported as
    /// opposite, -0.5 by default.
    pub opposite_correlation: f64,
    /// Minimum RMS difference of a logged derivative from the derivative of the position, %, with which a warning is
    /// reported, 20 by default.
    pub min_difference_percent: f64,
}

impl Default for ReportSettings {
    fn default() -> Self {
        Self {
            max_info_share: 5e-3,
            isolated_step_ratio: 20.0,
            isolated_range_share: 0.25,
            jump_step_ratio: 5.0,
            jump_range_share: 0.01,
            proportional_correlation: 0.98,
            min_log_factor: 0.05,
            unit_tolerance: 0.02,
            opposite_correlation: -0.5,
            min_difference_percent: 20.0,
        }
    }
}

impl ReportSettings {
    /// Checks the limits.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        for (name, value) in [
            ("max_info_share", self.max_info_share),
            ("isolated_step_ratio", self.isolated_step_ratio),
            ("isolated_range_share", self.isolated_range_share),
            ("jump_step_ratio", self.jump_step_ratio),
            ("jump_range_share", self.jump_range_share),
            ("min_log_factor", self.min_log_factor),
            ("unit_tolerance", self.unit_tolerance),
            ("min_difference_percent", self.min_difference_percent),
        ] {
            require(value.is_finite() && value >= 0.0, name, value, "give a finite number, 0 or more")?;
        }
        for (name, value) in [
            ("proportional_correlation", self.proportional_correlation),
            ("opposite_correlation", self.opposite_correlation),
        ] {
            require((-1.0..=1.0).contains(&value), name, value, "give -1 to 1")?;
        }
        Ok(())
    }
}
