//! Gains as additional unknowns of fits to rows in newton metres.

use super::gains::DriveGain;
use dynident_estimation::{EstimationError, LinearProblem};
use nalgebra::DMatrix;

/// Joints with unknown gains that the logs determine.
pub(crate) fn free_gains(gains: &[DriveGain]) -> Vec<usize> {
    (0..gains.len()).filter(|&joint| gains[joint].identified).collect()
}

/// Adds a column after all others for each of the joints `free`: the relative error κ of the joint's gain. From `u_j =
/// W_j (θ + c)/g_j` follows, to first order about the fit θ̂ with the gain ĝ and `g_j = ĝ_j/(1 + κ_j)`,
///
/// ```text
///     ĝ_j u_j − W_j c = W_j θ + κ_j W_j (θ̂ + c)
/// ```
///
/// The column is computed from the regressor, so it contains no torque noise. `known` is c of each log, and `values` is
/// θ̂, over the columns of the problem.
///
/// # Errors
/// The number of values is wrong.
pub fn with_free_gains(
    problem: LinearProblem,
    free: &[usize],
    known: &[Vec<f64>],
    values: &[f64],
) -> Result<LinearProblem, EstimationError> {
    if free.is_empty() {
        return Ok(problem);
    }
    let count = problem.columns().len();
    let names = free.iter().map(|&joint| format!("gain of {}", problem.joints()[joint]));
    let mut fallback = problem.fallback().to_vec();
    fallback.resize(count + free.len(), 0.0);
    let mut wider =
        LinearProblem::new(problem.columns().iter().cloned().chain(names).collect(), problem.joints().to_vec())
            .with_fallback(fallback)?
            .with_unexcited(problem.unexcited().clone())?;
    if let Some(prior) = problem.prior() {
        let mean = prior.mean().iter().copied().chain(free.iter().map(|_| 0.0)).collect();
        wider =
            wider.with_prior(mean, prior.sqrt_information().clone().resize_horizontally(count + free.len(), 0.0))?;
    }
    for equation in problem.equations() {
        let log = &problem.logs()[equation.log];
        let Some(place) = free.iter().position(|&joint| joint == equation.joint) else {
            wider.add(log, equation.joint, equation.columns.clone(), equation.factor.clone())?;
            continue;
        };
        let own = equation.columns.len();
        let mut map = DMatrix::zeros(own + 1, own + 2);
        for (local, &column) in equation.columns.iter().enumerate() {
            map[(local, local)] = 1.0;
            map[(local, own)] = values[column] + known[equation.log][column];
        }
        map[(own, own + 1)] = 1.0;
        let columns = equation.columns.iter().copied().chain([count + place]).collect();
        wider.add(log, equation.joint, columns, equation.factor.mapped(&map)?)?;
    }
    Ok(wider)
}
