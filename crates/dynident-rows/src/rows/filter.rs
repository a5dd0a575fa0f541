//! The low-pass and decimation that torque and regressor go through alike.

use dynident_recording::{DecimationSettings, MotionSettings};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The parallel filter: torque and every regressor column pass the same zero-phase low-pass, then every n-th row is
/// kept.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ParallelFilterSettings {
    /// Off: every sample counts as it is. On by default.
    pub enabled: bool,
    /// Every how many samples one is kept. By default so many that the filter's cut-off lies at 0.7 of the motion's.
    pub factor: Option<usize>,
    /// Frequency at which the filter's gain is one half; by default 0.4 of the rate that remains.
    pub cutoff_hz: Option<f64>,
    /// Width of the transition band; by default 0.4 of the rate that remains.
    pub transition_hz: Option<f64>,
    /// Attenuation in the stop band, dB; 60 by default.
    pub stop_band_db: f64,
}

impl Default for ParallelFilterSettings {
    fn default() -> Self {
        Self { enabled: true, factor: None, cutoff_hz: None, transition_hz: None, stop_band_db: 60.0 }
    }
}

impl From<Option<&DecimationSettings>> for ParallelFilterSettings {
    /// The same filter at any rate; `None` lets every sample count.
    fn from(filter: Option<&DecimationSettings>) -> Self {
        match filter {
            Some(&DecimationSettings { factor, cutoff_hz, transition_hz, stop_band_db }) => {
                Self { enabled: true, factor: Some(factor), cutoff_hz, transition_hz, stop_band_db }
            }
            None => Self { enabled: false, ..Self::default() },
        }
    }
}

/// Settings of the parallel filter that are impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ParallelFilterError {
    /// No sample would be kept.
    #[error("parallel_filter.factor = 0: give 1 or more")]
    ZeroFactor,
}

impl ParallelFilterSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// A factor of zero.
    pub fn validate(&self) -> Result<(), ParallelFilterError> {
        if self.factor == Some(0) {
            return Err(ParallelFilterError::ZeroFactor);
        }
        Ok(())
    }

    /// Rows a second that are left by default of a motion below this cut-off: the motion's cut-off is twice its highest
    /// frequency; with seven eighths of it per Nyquist band the filter's gain of one half lies at 0.7 of the cut-off,
    /// above all motion.
    pub fn rows_per_s(motion_cutoff_hz: f64) -> f64 {
        1.75 * motion_cutoff_hz
    }

    /// The filter in force at this rate for a motion that lies below `motion_cutoff_hz`; `None` where every sample
    /// counts.
    pub fn decimation(&self, rate_hz: f64, motion_cutoff_hz: Option<f64>) -> Option<DecimationSettings> {
        if !self.enabled {
            return None;
        }
        // It takes the same from torque and regressor, so it costs no bias.
        let automatic = motion_cutoff_hz
            .map_or(1, |cutoff| (rate_hz / Self::rows_per_s(cutoff)).floor().clamp(1.0, 1000.0) as usize);
        let factor = self.factor.unwrap_or(automatic);
        (factor > 1 || self.cutoff_hz.is_some()).then_some(DecimationSettings {
            factor,
            cutoff_hz: self.cutoff_hz,
            transition_hz: self.transition_hz,
            stop_band_db: self.stop_band_db,
        })
    }
}

/// The frequency below which the whole motion lies; unknown for differentiators without a cut-off, and where only the
/// deviation from a reference has one.
pub fn motion_band_hz(motion: &MotionSettings) -> Option<f64> {
    let differentiator = &motion.differentiator;
    differentiator.cutoff_hz().filter(|_| differentiator.reference().is_none())
}
