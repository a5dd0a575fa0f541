//! `[estimator.noise_levels]`: how `method = "noise-weighted"` finds the noise around a row.

use super::EstimatorSection;
use dynident_estimation::NoiseLevelSettings;
use serde::{Deserialize, Serialize};

/// `[estimator.noise_levels]`; see [`NoiseLevelSettings`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseLevelSection {
    /// Rows of one joint and log, centred on a row, whose residuals say how large the noise is there; 51 by default.
    pub window_rows: usize,
    /// Share of the joint's mean square residual in every level's square, 0 to 1; 1e-3 by default.
    pub pooled_share: f64,
    /// Most passes over the logs; 30 by default.
    pub max_passes: usize,
}

impl Default for NoiseLevelSection {
    fn default() -> Self {
        let NoiseLevelSettings { window_rows, pooled_share, max_passes, .. } = NoiseLevelSettings::default();
        Self { window_rows, pooled_share, max_passes }
    }
}

impl NoiseLevelSection {
    /// The estimator's settings.
    pub(crate) fn settings(&self, section: &EstimatorSection) -> NoiseLevelSettings {
        NoiseLevelSettings {
            window_rows: self.window_rows,
            pooled_share: self.pooled_share,
            max_passes: self.max_passes,
            rank: section.rank,
            covariance: section.covariance,
            ..NoiseLevelSettings::default()
        }
    }
}
