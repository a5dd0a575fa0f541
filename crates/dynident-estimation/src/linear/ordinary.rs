//! Ordinary least squares with equal weights.

use crate::error::EstimationError;
use crate::factor::{LinearProblem, RankSettings, solve, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use serde::{Deserialize, Serialize};

/// Settings of [`ordinary_least_squares`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OrdinarySettings {
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// Method of the reported covariance; from time segments by default.
    pub covariance: CovarianceMethod,
}

impl OrdinarySettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()
    }
}

/// `θ = argmin Σ_j ‖τ_j − W_j θ‖²` by orthogonal reduction, without normal equations.
///
/// The white-noise covariance is `s² (WᵀW)⁻¹` with `s² = RSS/(N − p)`. Golub and Van Loan, Matrix Computations, 5.3.
///
/// # Errors
/// [`EstimationError::Empty`], [`EstimationError::TooFewRows`], [`EstimationError::PriorWithoutNoiseLevel`] for a
/// problem with a prior, [`EstimationError::Setting`], and the errors of the chosen covariance.
#[doc(alias("ols", "least squares", "lstsq"))]
pub fn ordinary_least_squares(
    problem: &LinearProblem,
    settings: &OrdinarySettings,
) -> Result<Estimate, EstimationError> {
    settings.validate()?;
    if problem.prior().is_some() {
        return Err(EstimationError::PriorWithoutNoiseLevel);
    }
    let stacked = problem.stacked();
    let weights = vec![1.0; problem.joints().len()];
    let triangle = stacked.combined(&weights)?;
    let split = split(&triangle, &settings.rank, problem.unexcited());
    let degrees_of_freedom = joint_degrees_of_freedom(&stacked, split.free.len())?;
    let solution = solve(&triangle, &split, &settings.rank, problem.fallback());
    let (squares, _) = stacked.joint_squares(&solution.values)?;
    let joint_sigma = squares
        .iter()
        .zip(&degrees_of_freedom)
        .map(|(square, degrees_of_freedom)| (square / degrees_of_freedom).sqrt())
        .collect();
    let weighted_variance = squares.iter().sum::<f64>() / (triangle.rows() - split.free.len()) as f64;
    PointEstimate { triangle, split, solution, weights, joint_sigma, weighted_variance, iterations: 1, converged: true }
        .into_estimate(&stacked, &settings.rank, settings.covariance)
}
