//! Parallel filter: the common low-pass and decimation of torque and regressor.

use dynident_recording::{DecimationSettings, MotionSettings};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Settings of the parallel filter. Torque and every regressor column pass the same zero-phase low-pass; then every
/// n-th row is kept.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct ParallelFilterSettings {
    /// Whether the filter is used (default). Without it, every sample is a row.
    pub enabled: bool,
    /// Decimation factor. By default the cut-off of the filter is 0.7 of the cut-off of the motion.
    pub factor: Option<usize>,
    /// Half-gain frequency, hertz; by default 0.4 of the decimated rate.
    pub cutoff_hz: Option<f64>,
    /// Width of the transition band, hertz; by default 0.4 of the decimated rate.
    pub transition_hz: Option<f64>,
    /// Stop-band attenuation, dB; 60 by default.
    pub stop_band_db: f64,
}

impl Default for ParallelFilterSettings {
    fn default() -> Self {
        Self { enabled: true, factor: None, cutoff_hz: None, transition_hz: None, stop_band_db: 60.0 }
    }
}

impl From<Option<&DecimationSettings>> for ParallelFilterSettings {
    /// Settings of the parallel filter with the values of a decimation; `None` disables the filter.
    fn from(filter: Option<&DecimationSettings>) -> Self {
        match filter {
            Some(&DecimationSettings { factor, cutoff_hz, transition_hz, stop_band_db }) => {
                Self { enabled: true, factor: Some(factor), cutoff_hz, transition_hz, stop_band_db }
            }
            None => Self { enabled: false, ..Self::default() },
        }
    }
}

/// Invalid settings of the parallel filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ParallelFilterError {
    /// `factor` is the number of samples from which the parallel filter makes one row. Write 1 or more.
    #[error("parallel_filter.factor = 0: give 1 or more")]
    ZeroFactor,
}

impl ParallelFilterSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The factor is zero.
    pub fn validate(&self) -> Result<(), ParallelFilterError> {
        if self.factor == Some(0) {
            return Err(ParallelFilterError::ZeroFactor);
        }
        Ok(())
    }

    /// Default number of rows per second for this cut-off of the motion. The cut-off of the motion is twice its highest
    /// frequency. The Nyquist frequency of the rows is 7/8 of the cut-off, so that the half-gain frequency of the
    /// filter is 0.7 of the cut-off, above all motion.
    pub fn rows_per_s(motion_cutoff_hz: f64) -> f64 {
        1.75 * motion_cutoff_hz
    }

    /// Half-gain frequency of the filter with the default number of rows for this cut-off of the motion.
    pub fn half_gain_hz(motion_cutoff_hz: f64) -> f64 {
        0.7 * motion_cutoff_hz
    }

    /// Decimation at this rate for a motion below `motion_cutoff_hz`; `None` if every sample is a row.
    pub fn decimation(&self, rate_hz: f64, motion_cutoff_hz: Option<f64>) -> Option<DecimationSettings> {
        if !self.enabled {
            return None;
        }
        // The same filter acts on torque and regressor, so it adds no bias.
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

/// Highest frequency of the motion, hertz. `None` for differentiators without a cut-off, and for those that filter only
/// the deviation from a commanded motion.
pub fn motion_band_hz(motion: &MotionSettings) -> Option<f64> {
    let differentiator = &motion.differentiator;
    differentiator.cutoff_hz().filter(|_| differentiator.reference().is_none())
}
