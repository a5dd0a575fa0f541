//! Noise level of every joint in each log, used to weight logs.

use crate::estimators::{EstimationSettings, Estimator};
use dynident_estimation::{EstimationError, LinearProblem, weighted_values};

/// Maximum number of passes.
const MAX_PASSES: usize = 20;
/// Relative change of a noise level at which the passes end.
const MAX_RELATIVE_CHANGE: f64 = 1e-3;

/// Minimum noise of a log relative to the noisiest log; smaller values are rounding errors.
const MIN_NOISE_RATIO: f64 = 1e-6;

/// Whether training logs share the noise levels of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogNoise {
    /// One noise level for each joint.
    #[default]
    Shared,
    /// Separate noise levels for each log: `σ_jℓ = √(‖τ_jℓ - W_jℓ θ‖² / rows)` and θ by weighted least squares
    /// alternate until they converge. Residuals are then in units of the last log. Not available for ordinary least
    /// squares and for a caller's rule. For estimators that read the logs again it only affects the consistent set.
    Own,
}

/// Scales the rows of each joint and log to the last log's noise of that joint.
pub(crate) fn weighted_by_log(
    settings: &EstimationSettings,
    problem: LinearProblem,
) -> Result<LinearProblem, EstimationError> {
    let (logs, joints) = (problem.logs().len(), problem.joints().len());
    if logs < 2 || matches!(settings.estimator, Estimator::Ordinary | Estimator::Function(_)) {
        return Ok(problem);
    }
    let mut weights = vec![vec![1.0_f64; joints]; logs];
    for _ in 0..MAX_PASSES {
        let weighted = problem.clone().with_log_weights(|log, joint| weights[log][joint])?;
        let theta = weighted_values(&weighted, &settings.weighted())?.values;
        let next = weights_by(&problem, &theta)?;
        let change = |(old, new): (&Vec<f64>, &Vec<f64>)| {
            old.iter().zip(new).fold(0.0_f64, |most, (old, new)| most.max((new / old - 1.0).abs()))
        };
        let moved = weights.iter().zip(&next).map(change).fold(0.0, f64::max);
        weights = next;
        if moved <= MAX_RELATIVE_CHANGE {
            break;
        }
    }
    problem.with_log_weights(|log, joint| weights[log][joint])
}

/// For each log and joint the ratio of the last log's noise (with rows of the joint) to its own noise.
fn weights_by(problem: &LinearProblem, theta: &[f64]) -> Result<Vec<Vec<f64>>, EstimationError> {
    let (logs, joints) = (problem.logs().len(), problem.joints().len());
    let mut noise = vec![vec![0.0_f64; joints]; logs];
    for rows in problem.equations() {
        let local: Vec<f64> = rows.columns.iter().map(|&column| theta[column]).collect();
        let square = rows.factor.total().residual_sum_of_squares(&local)?;
        noise[rows.log][rows.joint] = (square / rows.factor.rows().max(1) as f64).sqrt();
    }
    let mut weights = vec![vec![1.0; joints]; logs];
    for joint in 0..joints {
        let largest = noise.iter().fold(0.0_f64, |most, of_log| most.max(of_log[joint]));
        let level = |log: usize| noise[log][joint].max(MIN_NOISE_RATIO * largest);
        let Some(last) = (0..logs).rfind(|&log| noise[log][joint] > 0.0) else { continue };
        for (log, weights) in weights.iter_mut().enumerate() {
            weights[joint] = level(last) / level(log);
        }
    }
    Ok(weights)
}
