//! Settings of a repeated motion.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Maximum period of a motion, s: eleven days.
const MAX_PERIOD_S: f64 = 1e6;

/// Settings of a repeated motion.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct PeriodSettings {
    /// Period of the motion, s; by default the length of the log's `reference`.
    pub period_s: Option<f64>,
    /// Time that is excluded at the start of every log, before the motion is periodic, s; 0 by default.
    pub skip_s: f64,
    /// Number of harmonics in the Fourier series of the motion, for the simultaneous fit only; by default all harmonics
    /// above the noise.
    pub harmonics: Option<usize>,
}

/// Periods of a repeated motion in results of earlier versions; kept so that these files can be read.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PeriodicFit {
    /// Period, s.
    pub period_s: f64,
    /// Number of averaged periods of each log.
    pub periods: Vec<usize>,
    /// Number of instants of all averaged periods in the fit.
    pub instants: usize,
    /// Standard deviation of the smoothed position, velocity and acceleration of a single sample, for each joint, rad,
    /// rad/s, rad/s² (m).
    pub motion_std: Vec<[f64; 3]>,
    /// Standard deviation of the filtered torque of a single sample, for each joint, Nm (N).
    pub torque_std: Vec<f64>,
    /// Cost function of the likelihood at the estimate.
    pub cost: f64,
    /// Expected cost if model and noise are correct.
    pub degrees_of_freedom: usize,
}

/// Invalid settings of a repeated motion.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PeriodError {
    /// `period_s` in `periods` under `[estimator]` is zero, negative or too large. Write the period of the commanded
    /// motion.
    #[error("period_s = {period_s:?}: give the period of the motion in seconds, at most {MAX_PERIOD_S:e}")]
    Period {
        /// Value.
        period_s: f64,
    },
    /// `skip_s` in `periods` under `[estimator]` is the time before the motion is periodic. It must not be negative.
    #[error("skip_s = {skip_s}: give 0 or more seconds")]
    Skip {
        /// Value.
        skip_s: f64,
    },
    /// `harmonics` in `periods` under `[estimator]` is the number of harmonics of the motion. It is outside its range.
    #[error("harmonics = {harmonics}: give 1 to 200")]
    Harmonics {
        /// Value.
        harmonics: usize,
    },
}

impl PeriodSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn validate(&self) -> Result<(), PeriodError> {
        if let Some(period_s) = self.period_s.filter(|period| !(*period > 0.0 && *period <= MAX_PERIOD_S)) {
            return Err(PeriodError::Period { period_s });
        }
        if !(self.skip_s >= 0.0 && self.skip_s.is_finite()) {
            return Err(PeriodError::Skip { skip_s: self.skip_s });
        }
        if let Some(harmonics) = self.harmonics.filter(|harmonics| !(1..=200).contains(harmonics)) {
            return Err(PeriodError::Harmonics { harmonics });
        }
        Ok(())
    }
}
