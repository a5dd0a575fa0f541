//! `[parallel_filter]`: the low-pass and decimation that torque and regressor go through alike.

use serde::{Deserialize, Serialize};

/// `[parallel_filter]`: torque and every regressor column pass the same zero-phase low-pass, then every n-th row is kept.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ParallelFilterSection {
    /// Off: every sample counts as it is. On by default.
    pub enabled: bool,
    /// Every how many samples one is kept. By default so many that the filter's cut-off lies at 0.7 of the motion's.
    pub factor: Option<usize>,
    /// Frequency at which the filter's gain is one half; by default 0.4 of the rate that remains.
    pub cutoff_hz: Option<f64>,
    /// Attenuation in the stop band, dB.
    pub stop_band_db: f64,
}

impl Default for ParallelFilterSection {
    fn default() -> Self {
        Self { enabled: true, factor: None, cutoff_hz: None, stop_band_db: 60.0 }
    }
}

impl ParallelFilterSection {
    pub(crate) fn validate(&self) -> Result<(), String> {
        if self.factor == Some(0) {
            return Err("parallel_filter.factor = 0: give 1 or more".to_owned());
        }
        Ok(())
    }
}
