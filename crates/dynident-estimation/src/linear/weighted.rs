//! Weighted least squares with the noise level of each joint.

use super::noise_step::newton_weights;
use crate::error::{EstimationError, require, within};
use crate::factor::{LinearProblem, RankSettings, Solution, StackedProblem, solved_values, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use serde::{Deserialize, Serialize};

/// Settings of [`weighted_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WeightedSettings {
    /// Criteria for an excited column.
    pub rank: RankSettings,
    /// Method of the reported covariance; from time segments by default.
    pub covariance: CovarianceMethod,
    /// The iteration ends when no joint's σ changes by more than this share. Default 1e-6: far below the accuracy of
    /// any σ.
    pub tolerance: f64,
    /// Maximum number of solutions. Default 50; four to six are usual.
    pub max_iterations: usize,
}

impl Default for WeightedSettings {
    fn default() -> Self {
        Self {
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            tolerance: 1.0e-6,
            max_iterations: 50,
        }
    }
}

impl WeightedSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for a tolerance outside 1e-12 to 1, zero iterations, or rank settings out of
    /// range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        within("tolerance", self.tolerance, 1.0e-12..=1.0, "use a relative change from 1e-12 to 1")?;
        require(self.max_iterations > 0, "max_iterations", 0.0, "use at least 1")
    }
}

/// Lower limit of a joint's σ relative to its RMS torque. For noise-free (simulated) torque the residual is rounding
/// error, and weights from it would not converge.
const MIN_SIGMA_SHARE: f64 = 1.0e-9;

/// Values and noise levels without a covariance for correlated errors.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedValues {
    /// One value per column; the fallback value for an unexcited column.
    pub values: Vec<f64>,
    /// For every joint the standard deviation of its residual, as in [`Estimate::joint_sigma`].
    pub joint_sigma: Vec<f64>,
    /// Standard deviation of every value for errors that are independent from sample to sample, the root of the
    /// diagonal of [`Estimate::covariance_white`]; zero for an unexcited column.
    pub white_std: Vec<f64>,
    /// Number of solutions.
    pub iterations: usize,
    /// Whether the noise levels converged within the iteration limit.
    pub converged: bool,
}

/// Solves `θ = argmin Σ_j ‖τ_j − W_j θ‖² / σ_j²` with `σ_j² = ‖τ_j − W_j θ‖² / (N_j − p/n)`, iterated from σ_j = 1
/// until the noise levels σ_j converge. N_j is the number of rows of joint j, p that of estimated columns, n that of
/// joints. A [prior](LinearProblem::with_prior) adds `‖S(θ − m)‖²`.
///
/// The white-noise covariance is `(Σ_j W_jᵀW_j / σ_j² + SᵀS)⁻¹`. The excited columns are selected once, on the first
/// solution. After the second solution Newton's step updates the σ_j as long as it improves convergence. Gautier,
/// "Dynamic identification of robots with power model", ICRA 1997; Swevers, Verdonck and De Schutter, IEEE Control
/// Systems Magazine 27 (2007) 58.
///
/// # Errors
/// [`EstimationError::Empty`], [`EstimationError::TooFewRows`], [`EstimationError::Setting`], and the errors of the
/// chosen covariance. Reaching `max_iterations` is a status, not an error.
#[doc(alias("wls", "idim-ls", "idim", "iteratively reweighted"))]
pub fn weighted_least_squares(
    problem: &LinearProblem,
    settings: &WeightedSettings,
) -> Result<Estimate, EstimationError> {
    let stacked = problem.stacked();
    iterated(&stacked, settings)?.into_estimate(&stacked, &settings.rank, settings.covariance)
}

/// The values and noise levels of [`weighted_least_squares`] without its covariance and rank report, in at most half
/// the time.
///
/// # Errors
/// Same as for [`weighted_least_squares`]; [`EstimationError::Overflow`] for a value that is not finite.
pub fn weighted_values(
    problem: &LinearProblem,
    settings: &WeightedSettings,
) -> Result<WeightedValues, EstimationError> {
    let PointEstimate { split, solution, joint_sigma, iterations, converged, .. } =
        iterated(&problem.stacked(), settings)?;
    let Solution { values, inverse } = solution;
    let mut white_std = vec![0.0; values.len()];
    for (row, &column) in split.free.iter().enumerate() {
        white_std[column] = inverse.row(row).norm();
    }
    match (0..values.len()).find(|&column| !(values[column].is_finite() && white_std[column].is_finite())) {
        Some(column) => Err(EstimationError::Overflow { name: problem.columns()[column].clone() }),
        None => Ok(WeightedValues { values, joint_sigma, white_std, iterations, converged }),
    }
}

fn iterated(stacked: &StackedProblem<'_>, settings: &WeightedSettings) -> Result<PointEstimate, EstimationError> {
    settings.validate()?;
    let problem = stacked.problem;
    let mut weights = vec![1.0; problem.joints().len()];
    let mut triangle = stacked.combined(&weights)?;
    let split = split(&triangle, &settings.rank, problem.unexcited());
    let degrees_of_freedom = joint_degrees_of_freedom(stacked, split.free.len())?;
    let mut solution = solved_values(&triangle, &split, &settings.rank, problem.fallback());
    let mut iterations = 1;
    let (mut last_change, mut is_newton, mut newton_helps) = (f64::INFINITY, false, true);
    let (joint_sigma, converged) = loop {
        let (squares, torque) = stacked.joint_squares(&solution.values)?;
        let joint_sigma = noise_of_joints(&squares, &torque, &degrees_of_freedom);
        // The first weights are not a noise estimate.
        let change = if iterations > 1 { noise_change(&joint_sigma, &weights) } else { f64::INFINITY };
        let has_settled = change <= settings.tolerance;
        if has_settled || iterations == settings.max_iterations {
            break (joint_sigma, has_settled);
        }
        // Newton's step is skipped in the first iteration and disabled once it does not improve convergence.
        newton_helps &= !is_newton || change <= 0.5 * last_change;
        let newton = || newton_weights(stacked, &split, &solution, &weights, &joint_sigma, &degrees_of_freedom);
        let next = if iterations > 1 && newton_helps { newton() } else { None };
        (last_change, is_newton) = (change, next.is_some());
        weights = next.unwrap_or_else(|| joint_sigma.iter().map(|sigma| sigma.recip()).collect());
        triangle = stacked.combined(&weights)?;
        solution = solved_values(&triangle, &split, &settings.rank, problem.fallback());
        iterations += 1;
    };
    // The rows are scaled by the last weights. After convergence their noise is one, up to the tolerance.
    let (solution, weighted_variance) = (solution.with_inverse(), 1.0);
    Ok(PointEstimate { triangle, split, solution, weights, joint_sigma, weighted_variance, iterations, converged })
}

/// Largest relative change of the noise between the weights and the residuals of their solution.
pub(crate) fn noise_change(joint_sigma: &[f64], weights: &[f64]) -> f64 {
    joint_sigma.iter().zip(weights).map(|(s, w)| (s * w - 1.0).abs()).fold(0.0, f64::max)
}

/// Noise of every joint, at least the rounding of its torque.
pub(crate) fn noise_of_joints(squares: &[f64], torque: &[f64], degrees_of_freedom: &[f64]) -> Vec<f64> {
    let largest = torque.iter().zip(degrees_of_freedom).map(|(t, f)| t / f).fold(0.0, f64::max);
    let of_joint = |joint: usize| {
        let rms = (if torque[joint] > 0.0 { torque[joint] / degrees_of_freedom[joint] } else { largest }).sqrt();
        let floor = MIN_SIGMA_SHARE * if rms > 0.0 { rms } else { 1.0 };
        (squares[joint] / degrees_of_freedom[joint]).sqrt().max(floor)
    };
    (0..squares.len()).map(of_joint).collect()
}
