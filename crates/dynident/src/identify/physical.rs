//! From an estimate to the bodies of a possible machine, and what is told of it.

use crate::identify::result::{PhysicalBodyResult, PhysicalFitResult};
use crate::machine::Machine;
use crate::study::EstimatorMethod;
use dynident_estimation::consistent::{PhysicalFit, PhysicalStatus};
use dynident_estimation::{Estimate, LinearProblem};
use dynident_identification::consistent::{
    ConsistencyError, ConsistencySettings, consistent_parameters, nearest_consistent_parameters,
};

/// The possible set of parameters that fits the logs best, from the factors that the estimate was made from; or, where another estimator than least squares was asked for, the one nearest to its
/// estimate in the metric of these factors. Otherwise the reason why there is none.
pub(crate) fn possible_parameters(
    machine: &Machine,
    problem: &LinearProblem,
    estimate: &Estimate,
    (method, settings): (EstimatorMethod, &ConsistencySettings),
) -> Result<PhysicalFit, ConsistencyError> {
    let (robot, sigma) = (&machine.parametric, &estimate.joint_sigma);
    if method.is_plain() {
        consistent_parameters(robot, problem, sigma, settings)
    } else {
        nearest_consistent_parameters(robot, problem, sigma, settings, &estimate.values)
    }
}

/// The section of `result.json` about the fit.
pub(crate) fn physical_fit_result(fit: &PhysicalFit, estimate: &Estimate) -> PhysicalFitResult {
    PhysicalFitResult {
        status: match fit.status {
            PhysicalStatus::Solved => "solved",
            PhysicalStatus::Stalled => "stalled",
            PhysicalStatus::IterationLimit => "iteration-limit",
        },
        iterations: fit.iterations,
        stationarity: fit.stationarity,
        duality_gap: fit.duality_gap,
        moved_sigma: fit.moved_sigma,
        largest_move_std: fit
            .moves_in_std(&estimate.values, &estimate.std)
            .ok()
            .and_then(|moves| moves.into_iter().flatten().map(f64::abs).max_by(f64::total_cmp)),
        active: fit.active.clone(),
        bodies: fit
            .bodies
            .iter()
            .map(|body| PhysicalBodyResult {
                name: body.name.clone(),
                margin: body.least_whitened_eigenvalue,
                on_the_boundary: body.on_the_boundary,
            })
            .collect(),
    }
}
