//! Separates motion from noise in the high-frequency part of a measured motion: the torque contains only the effect
//! of the motion.

use super::instrumental::InstrumentalEstimate;
use super::projection::Projection;
use super::weighted::{WeightedSettings, weighted_least_squares};
use crate::error::EstimationError;
use crate::factor::{InstrumentedProblem, RankSettings};
use crate::uncertainty::CovarianceMethod;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Response of the torque to the part of the regressor that the instruments do not explain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FastMotion {
    /// κ: 1 if this part is real motion, 0 if it is position noise.
    pub followed: f64,
    /// Half-width of its 95 % interval, from time segments.
    pub half_width_95: f64,
    /// RMS of the torque of this part relative to that of the whole motion, with each joint scaled by its noise.
    pub share_of_torque: f64,
}

/// `κ = argmin Σ_j ‖τ_j - W̃_j θ - κ V_j θ‖² / σ_j²`, with `W = W̃ + V`, `W̃ = Z(ZᵀZ)⁻¹ZᵀW` and θ the instrumental
/// estimate.
///
/// κ is one number for the whole part V of the regressor that instruments of a lower bandwidth do not explain. Real
/// fast motion needs torque (κ = 1), position noise does not (κ = 0); between 0 and 1, κ is the share of motion. If
/// only the model is wrong in fast motion, the torque still follows most of the motion. So κ distinguishes noise from
/// a wrong model. The Durbin-Wu-Hausman test ([`hausman_test`](crate::hausman_test)) rejects for either. κ needs only
/// two time segments, for any number of parameters.
///
/// `None` if the instruments explain the whole regressor or if the rows do not determine κ.
///
/// # Errors
/// [`EstimationError::Setting`] and [`EstimationError::Mismatch`] for an estimate of another problem.
pub fn fast_motion(
    problem: &InstrumentedProblem,
    found: &InstrumentalEstimate,
    rank: RankSettings,
    covariance: CovarianceMethod,
) -> Result<Option<FastMotion>, EstimationError> {
    let estimate = &found.estimate;
    crate::error::expect("joints of the estimate", problem.joints().len(), estimate.joint_sigma.len())?;
    crate::error::expect("columns of the estimate", problem.columns().len(), estimate.values.len())?;
    let weights: Vec<f64> = estimate.joint_sigma.iter().map(|sigma| 1.0 / sigma).collect();
    let projection = Projection::new(problem, &problem.rows.stacked(), &weights, &rank)?;
    let theta = nalgebra::DVector::from_column_slice(&estimate.values);
    let names = vec!["fast motion".to_owned()];
    let fast = problem.combined(names, vec![1.0], |local| {
        let (fitted, left) = projection.parts(local);
        let size = fitted.nrows();
        let mut rows = DMatrix::zeros(size, 2);
        rows.set_column(0, &(left * &theta));
        let mut torque = -(fitted * &theta);
        torque[size - 1] += 1.0;
        rows.set_column(1, &torque);
        rows
    })?;
    let square = |triangle: &crate::factor::TriangularFactor| {
        let (rows, values) = (triangle.regressor_triangle(), &theta);
        (rows * values).norm_squared()
    };
    let (left, explained) = (square(&projection.left), square(&projection.explained));
    let settings = WeightedSettings { rank, covariance, ..WeightedSettings::default() };
    let Ok(fit) = weighted_least_squares(&fast, &settings) else { return Ok(None) };
    let (followed, half_width_95) = (fit.values[0], fit.half_width_95[0]);
    let is_told = fit.rank.fixed.is_empty() && followed.is_finite() && half_width_95.is_finite() && left > 0.0;
    if !is_told {
        return Ok(None);
    }
    Ok(Some(FastMotion { followed, half_width_95, share_of_torque: (left / (left + explained)).sqrt() }))
}
