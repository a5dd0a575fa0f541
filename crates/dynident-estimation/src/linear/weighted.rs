//! Weighted least squares: the rows of each joint count by that joint's own noise.

use super::noise_step::newton_weights;
use crate::error::{EstimationError, require, within};
use crate::factor::{LinearProblem, RankSettings, Solution, StackedProblem, solved_values, split};
use crate::uncertainty::{CovarianceMethod, Estimate, PointEstimate, joint_degrees_of_freedom};
use serde::{Deserialize, Serialize};

/// Settings of [`weighted_least_squares`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WeightedSettings {
    /// When a column counts as excited.
    pub rank: RankSettings,
    /// The covariance to report; from time segments by default.
    pub covariance: CovarianceMethod,
    /// Largest relative change of any joint's σ at which the iteration ends. Default 1e-6: far below the accuracy of
    /// any σ.
    pub tolerance: f64,
    /// Most solutions made. Default 50; four to six are usual.
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
    /// [`EstimationError::Setting`] for a tolerance outside 1e-12 to 1, no iterations, or rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        within("tolerance", self.tolerance, 1.0e-12..=1.0, "give a relative change from 1e-12 to 1")?;
        require(self.max_iterations > 0, "max_iterations", 0.0, "give at least 1")
    }
}

/// A joint's σ never falls below this share of its torque's root mean square: with noise-free (simulated) torque the
/// residual is rounding error, and weights made of it would wander for ever.
const SMALLEST_SIGMA: f64 = 1.0e-9;

/// What weighted least squares finds before anything is said of its accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedValues {
    /// One value per column; a column that is not excited has its fallback value.
    pub values: Vec<f64>,
    /// For every joint the standard deviation of its residual, as in [`Estimate::joint_sigma`].
    pub joint_sigma: Vec<f64>,
    /// Standard deviation of every value if errors are independent from sample to sample, the root of the diagonal of
    /// [`Estimate::covariance_white`]; zero for a column that is not excited.
    pub white_std: Vec<f64>,
    /// Solutions made.
    pub iterations: usize,
    /// Whether the noise of the joints settled within the iterations allowed.
    pub converged: bool,
}

/// `θ = argmin Σ_j ‖τ_j − W_j θ‖² / σ_j²` with `σ_j² = ‖τ_j − W_j θ‖² / (N_j − p/n)`, iterated from σ_j = 1 until the
/// σ_j settle; N_j are the joint's rows, p the estimated columns, n the joints. A [prior](LinearProblem::with_prior)
/// adds `‖S(θ − m)‖²`.
///
/// The white-noise covariance is `(Σ_j W_jᵀW_j / σ_j² + SᵀS)⁻¹`. Which columns are excited is decided once, on the
/// first solution. Behind the second solution the σ_j move by Newton's step as long as it brings them nearer. Gautier,
/// "Dynamic identification of robots with power model", ICRA 1997; Swevers, Verdonck and De Schutter, IEEE Control
/// Systems Magazine 27 (2007) 58.
///
/// # Errors
/// [`EstimationError::Empty`] and [`EstimationError::TooFewRows`] when there is nothing to estimate from,
/// [`EstimationError::Setting`], and the errors of the chosen covariance. Reaching `max_iterations` is a status, not an
/// error.
#[doc(alias("wls", "idim-ls", "idim", "iteratively reweighted"))]
pub fn weighted_least_squares(
    problem: &LinearProblem,
    settings: &WeightedSettings,
) -> Result<Estimate, EstimationError> {
    let stacked = problem.stacked();
    iterated(&stacked, settings)?.into_estimate(&stacked, &settings.rank, settings.covariance)
}

/// The values and the noise of [`weighted_least_squares`], without bars that hold correlated errors and without a
/// report of the rank: half of its time or less.
///
/// # Errors
/// As [`weighted_least_squares`]; [`EstimationError::Overflow`] for a value that is not finite.
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

/// Solutions with the noise of the one before, until it has settled.
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
        // The weights of the first solution stand for no noise.
        let change = if iterations > 1 { noise_change(&joint_sigma, &weights) } else { f64::INFINITY };
        let has_settled = change <= settings.tolerance;
        if has_settled || iterations == settings.max_iterations {
            break (joint_sigma, has_settled);
        }
        // Newton's step from weights that are not those of the start; one that does not lead nearer is the last.
        newton_helps &= !is_newton || change <= 0.5 * last_change;
        let newton = || newton_weights(stacked, &split, &solution, &weights, &joint_sigma, &degrees_of_freedom);
        let next = if iterations > 1 && newton_helps { newton() } else { None };
        (last_change, is_newton) = (change, next.is_some());
        weights = next.unwrap_or_else(|| joint_sigma.iter().map(|sigma| sigma.recip()).collect());
        triangle = stacked.combined(&weights)?;
        solution = solved_values(&triangle, &split, &settings.rank, problem.fallback());
        iterations += 1;
    };
    // The rows were scaled by the last weights; what noise is left in them is one up to the tolerance, unless the limit
    // came first.
    let (solution, weighted_variance) = (solution.with_inverse(), 1.0);
    Ok(PointEstimate { triangle, split, solution, weights, joint_sigma, weighted_variance, iterations, converged })
}

/// Largest relative change from the noise that the weights stand for to the noise that was found with them.
pub(crate) fn noise_change(joint_sigma: &[f64], weights: &[f64]) -> f64 {
    joint_sigma.iter().zip(weights).map(|(s, w)| (s * w - 1.0).abs()).fold(0.0, f64::max)
}

/// Noise of every joint, never below the rounding of its torque.
pub(crate) fn noise_of_joints(squares: &[f64], torque: &[f64], degrees_of_freedom: &[f64]) -> Vec<f64> {
    let largest = torque.iter().zip(degrees_of_freedom).map(|(t, f)| t / f).fold(0.0, f64::max);
    let of_joint = |joint: usize| {
        let rms = (if torque[joint] > 0.0 { torque[joint] / degrees_of_freedom[joint] } else { largest }).sqrt();
        let floor = SMALLEST_SIGMA * if rms > 0.0 { rms } else { 1.0 };
        (squares[joint] / degrees_of_freedom[joint]).sqrt().max(floor)
    };
    (0..squares.len()).map(of_joint).collect()
}
