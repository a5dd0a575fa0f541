//! Noise of every joint log by log: a log that shows the model worse than another counts less.

use crate::estimators::{EstimationSettings, Estimator};
use dynident_estimation::{EstimationError, LinearProblem, weighted_values};

/// Passes at most, and the change of a noise level, as a share of it, at which they have settled.
const PASSES: usize = 20;
const SETTLED: f64 = 1e-3;

/// The smallest noise of a log as a share of that of the log with the largest: below it is rounding.
const LEAST: f64 = 1e-6;

/// Whether training logs share the noise levels of their joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogNoise {
    /// One for each joint.
    #[default]
    Shared,
    /// Each log has its own: `σ_jℓ = √(‖τ_jℓ - W_jℓ θ‖² / rows)` and θ by weighted least squares in turn, until they
    /// settle. Residuals are then those of the last log. Not for ordinary least squares, which knows no weights, nor
    /// for a caller's own rule, which sees the rows as they are; for estimators that go back to the logs it shapes the
    /// consistent set alone.
    Own,
}

/// The problem with the rows of each joint and log in units of the last log's noise of that joint.
///
/// # Errors
/// Rows that do not carry an estimate.
pub(crate) fn weighted_by_log(
    settings: &EstimationSettings,
    problem: LinearProblem,
) -> Result<LinearProblem, EstimationError> {
    let (logs, joints) = (problem.logs().len(), problem.joints().len());
    if logs < 2 || matches!(settings.estimator, Estimator::Ordinary | Estimator::Function(_)) {
        return Ok(problem);
    }
    let mut weights = vec![vec![1.0_f64; joints]; logs];
    for _ in 0..PASSES {
        let weighted = problem.clone().with_log_weights(|log, joint| weights[log][joint])?;
        let theta = weighted_values(&weighted, &settings.weighted())?.values;
        let next = weights_by(&problem, &theta)?;
        let change = |(old, new): (&Vec<f64>, &Vec<f64>)| {
            old.iter().zip(new).fold(0.0_f64, |most, (old, new)| most.max((new / old - 1.0).abs()))
        };
        let moved = weights.iter().zip(&next).map(change).fold(0.0, f64::max);
        weights = next;
        if moved <= SETTLED {
            break;
        }
    }
    problem.with_log_weights(|log, joint| weights[log][joint])
}

/// For each log and joint the noise of the last log that has rows of the joint over its own.
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
        let level = |log: usize| noise[log][joint].max(LEAST * largest);
        let Some(last) = (0..logs).rfind(|&log| noise[log][joint] > 0.0) else { continue };
        for (log, weights) in weights.iter_mut().enumerate() {
            weights[joint] = level(last) / level(log);
        }
    }
    Ok(weights)
}
