//! Limits of the decision on the clock.

use crate::error::{FilterError, require};

/// Limits of the decision on the times of samples ([`Clock`](super::Clock)). They are not part of a study file.
#[derive(Clone, Debug, PartialEq)]
pub struct ClockSettings {
    /// Ratio of the standard deviation of the time steps to their mean below which the spacing is treated as even. At
    /// the default of 0.1 %, a wrong decision causes a position error of a thousandth of the motion within one step.
    pub negligible_jitter: f64,
    /// Minimum relative improvement of the position prediction with which even spacing or the stamps are preferred to
    /// the other, 0.1 by default.
    pub min_improvement: f64,
    /// Minimum share of rows with equal stamps that also repeat the position, with which such rows are treated as
    /// copies, 0.9 by default.
    pub min_repeat_share: f64,
    /// Minimum deviation of the smoothed stamps from an even grid, in steps, with which the smoothed stamps are used
    /// instead of the grid, 1 by default.
    pub min_drift_steps: f64,
    /// Minimum relative variation of the rate (RMS) with which the smoothed stamps are used, in addition to
    /// `min_drift_steps`; 1e-3 by default. With an even grid instead, velocities would have this relative error and
    /// inertias twice this error.
    pub min_rate_variation: f64,
}

impl Default for ClockSettings {
    fn default() -> Self {
        Self {
            negligible_jitter: 1e-3,
            min_improvement: 0.1,
            min_repeat_share: 0.9,
            min_drift_steps: 1.0,
            min_rate_variation: 1e-3,
        }
    }
}

impl ClockSettings {
    /// Checks the limits.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        for (name, value) in [
            ("negligible_jitter", self.negligible_jitter),
            ("min_drift_steps", self.min_drift_steps),
            ("min_rate_variation", self.min_rate_variation),
        ] {
            require(value.is_finite() && value >= 0.0, name, value, "give a finite number, 0 or more")?;
        }
        for (name, value) in [("min_improvement", self.min_improvement), ("min_repeat_share", self.min_repeat_share)] {
            require((0.0..=1.0).contains(&value), name, value, "give 0 to 1")?;
        }
        Ok(())
    }
}
