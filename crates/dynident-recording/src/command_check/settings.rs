//! Thresholds of the check of commanded motions.

use crate::error::{FilterError, require};

/// Thresholds of [`check_commands`](super::check_commands). They are not part of a study file.
///
/// The defaults were chosen with 18 recordings of a real arm with six servos (SO-101, 50 Hz, position errors by gravity
/// up to 0.09 rad, lag 0.06 to 0.5 s) and with simulated first-order responses. One of the recordings has a fault, a
/// clamped command; with the defaults, only this fault is reported.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandCheckSettings {
    /// Longest lag between command and position that is searched, s. Default 0.5.
    pub max_lag_s: f64,
    /// Smallest range of a command whose effect is judged, rad or m. Default 0.05: smaller commands may not overcome
    /// the stiction of a servo (0.03 rad in the recordings).
    pub min_command_range: f64,
    /// Correlation of command and position above which both describe the same motion. Default 0.7; the recordings have
    /// 0.78 to 1.
    pub min_correlation: f64,
    /// Correlation of command and position below which a moving joint does not follow its command. Default 0.5.
    pub max_unrelated_correlation: f64,
    /// Range of the position, as a share of the range of the command, below which the command has no effect. Default
    /// 0.1; the recordings have 0.68 and more.
    pub min_effect_share: f64,
    /// Smallest constant difference of position and command that is reported as different zeros, rad or m. Default
    /// 0.15: gravity causes errors of a loaded servo up to 0.09 rad.
    pub min_offset: f64,
    /// Smallest excess of a command over a limit of the position that is reported, rad or m. Default 0.15: dynamic
    /// motions of the recordings reach 0.11.
    pub min_clamped_excess: f64,
    /// Shortest total time of a clamped command that is reported, s. Default 0.3.
    pub min_clamped_s: f64,
    /// Smallest jump of a position that is reported, encoder counts. Default 8; the position of a servo at rest changes
    /// by one count.
    pub min_jump_counts: f64,
    /// Smallest ratio of a jump to the other steps of the joint within 0.2 s. Default 5, as for logs with torque.
    pub jump_step_ratio: f64,
}

impl Default for CommandCheckSettings {
    fn default() -> Self {
        Self {
            max_lag_s: 0.5,
            min_command_range: 0.05,
            min_correlation: 0.7,
            max_unrelated_correlation: 0.5,
            min_effect_share: 0.1,
            min_offset: 0.15,
            min_clamped_excess: 0.15,
            min_clamped_s: 0.3,
            min_jump_counts: 8.0,
            jump_step_ratio: 5.0,
        }
    }
}

impl CommandCheckSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        for (name, value) in [
            ("max_lag_s", self.max_lag_s),
            ("min_command_range", self.min_command_range),
            ("min_offset", self.min_offset),
            ("min_clamped_excess", self.min_clamped_excess),
            ("min_clamped_s", self.min_clamped_s),
            ("min_jump_counts", self.min_jump_counts),
            ("jump_step_ratio", self.jump_step_ratio),
        ] {
            require(value.is_finite() && value > 0.0, name, value, "give a finite number above 0")?;
        }
        for (name, value) in [
            ("min_correlation", self.min_correlation),
            ("max_unrelated_correlation", self.max_unrelated_correlation),
            ("min_effect_share", self.min_effect_share),
        ] {
            require((0.0..=1.0).contains(&value), name, value, "give 0 to 1")?;
        }
        Ok(())
    }
}
