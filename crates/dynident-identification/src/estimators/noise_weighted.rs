//! Weighting of rows by the local noise level.

use super::row_pass::{KeptRows, PassError};
use super::{EstimationSettings, EstimatorError, Findings, TrainingRows};
use dynident_estimation::{Estimate, NoiseLevelSettings, noise_weighted_least_squares};
use serde::{Deserialize, Serialize};

/// Settings for the local noise level; see [`NoiseLevelSettings`].
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct NoiseLevels {
    /// Number of rows of one joint and log, centred on a row, whose residuals determine the noise level of this row; 51
    /// by default.
    pub window_rows: usize,
    /// Share of the joint's mean square residual that is mixed into the square of every noise level, 0 to 1; 1e-3 by
    /// default.
    pub pooled_share: f64,
    /// Maximum number of passes over the logs; 30 by default.
    pub max_passes: usize,
}

impl Default for NoiseLevels {
    fn default() -> Self {
        let NoiseLevelSettings { window_rows, pooled_share, max_passes, .. } = NoiseLevelSettings::default();
        Self { window_rows, pooled_share, max_passes }
    }
}

impl NoiseLevels {
    /// Settings of the estimator.
    pub fn settings(&self, estimation: &EstimationSettings) -> NoiseLevelSettings {
        NoiseLevelSettings {
            window_rows: self.window_rows,
            pooled_share: self.pooled_share,
            max_passes: self.max_passes,
            rank: estimation.rank,
            covariance: estimation.covariance,
            ..NoiseLevelSettings::default()
        }
    }
}

pub(super) fn noise_weighted(
    rows: &TrainingRows<'_>,
    levels: &NoiseLevels,
) -> Result<(Estimate, Findings), EstimatorError> {
    let settings = levels.settings(rows.settings);
    let mut kept = KeptRows::new();
    let found =
        noise_weighted_least_squares::<PassError>(rows.problem, &settings, |visit| kept.every_row(rows, visit))?;
    Ok((found.estimate, Findings::NoiseLevels(found.level_range)))
}
