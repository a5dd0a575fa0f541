//! Noise level of every joint in each log, from which logs get their weights.

use crate::estimators::{EstimationSettings, Estimator};
use dynident_estimation::{EstimationError, LinearProblem, weighted_values};

/// Maximum number of iterations.
const MAX_PASSES: usize = 20;
/// Relative change of a noise level below which the iterations end.
const MAX_RELATIVE_CHANGE: f64 = 1e-3;

/// Minimum noise of a log relative to the noisiest log; smaller values are rounding errors.
const MIN_NOISE_RATIO: f64 = 1e-6;

/// Whether training logs share the noise levels of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogNoise {
    /// One noise level for each joint.
    #[default]
    Shared,
    /// Separate noise levels for each log. The noise `σ_jℓ = √(‖τ_jℓ - W_jℓ θ‖² / rows)` of joint j in log ℓ and the
    /// weighted least-squares estimate θ are computed alternately until they converge. The rows are scaled to the noise
    /// of the last log. Not available for ordinary least squares and for an estimator of the caller. For estimators
    /// that read the logs again, this setting affects only the physically consistent set.
    Own,
}

/// Scales the rows of each joint and log so that their noise equals the noise of the joint in the last log.
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

/// Weights for each log and joint: the noise of the joint in the last log (with rows of the joint), divided by its
/// noise in this log.
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
