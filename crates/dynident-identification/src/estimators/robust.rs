//! Iteratively reweighted least squares, which gives outliers less weight or none.

use super::row_pass::{KeptRows, PassError};
use super::{EstimatorError, Findings, TrainingRows};
use dynident_estimation::{Estimate, RobustSettings, RowWeight, robust_least_squares};
use serde::{Deserialize, Serialize};

/// Weights of the rows in a robust estimator, for each joint.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct GrossErrors {
    /// Share of rows with a weight below one half.
    pub share: Vec<f64>,
    /// Mean weight of the rows.
    pub mean_weight: Vec<f64>,
}

pub(super) fn robust(rows: &TrainingRows<'_>, weight: RowWeight) -> Result<(Estimate, Findings), EstimatorError> {
    let estimation = rows.settings;
    let settings = RobustSettings {
        weight,
        rank: estimation.rank,
        covariance: estimation.covariance,
        ..RobustSettings::default()
    };
    let mut kept = KeptRows::new();
    let found = robust_least_squares::<PassError>(rows.problem, &settings, |visit| kept.every_row(rows, visit))?;
    let errors = GrossErrors { share: found.outlier_share, mean_weight: found.mean_weight };
    Ok((found.estimate, Findings::GrossErrors(errors)))
}
