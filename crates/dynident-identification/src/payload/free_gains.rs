//! Torque gains as additional unknowns, for fits to rows that are already in newton metres.

use super::gains::DriveGain;
use dynident_estimation::{EstimationError, LinearProblem};
use nalgebra::DMatrix;

/// Joints whose unknown gains the logs determine.
pub(crate) fn free_gains(gains: &[DriveGain]) -> Vec<usize> {
    (0..gains.len()).filter(|&joint| gains[joint].identified).collect()
}

/// Adds a column after all others for each joint in `free`: the relative error κ_j of the joint's gain. The logged
/// value of joint j is `u_j = W_j (θ + c)/g_j` with regressor W_j, base parameters θ, known payload c and gain g_j.
/// With the fitted values θ̂ and ĝ_j, and `g_j = ĝ_j/(1 + κ_j)`, this gives to first order
///
/// ```text
///     ĝ_j u_j − W_j c = W_j θ + κ_j W_j (θ̂ + c)
/// ```
///
/// The column is computed from the regressor, so it contains no torque noise. `known` contains c for each log, and
/// `values` is θ̂; both have the columns of the problem.
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
