//! Physically consistent parameters for any estimate.

use super::error::ConsistencyError;
use super::problem::{consistent_parameters, nearest_consistent_parameters};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::PhysicalFit;
use dynident_estimation::{Estimate, LinearProblem};

/// The best physically consistent fit to the rows of the estimate. If the estimate is not the least-squares solution of
/// these rows (`plain` is false), the physically consistent parameters with the smallest torque difference from the
/// estimate on these rows.
///
/// # Errors
/// As [`consistent_parameters`].
pub fn consistent_with_estimate(
    robot: &ParametricModel,
    problem: &LinearProblem,
    estimate: &Estimate,
    plain: bool,
    settings: &ConsistencySettings,
) -> Result<PhysicalFit, ConsistencyError> {
    let sigma = &estimate.joint_sigma;
    if plain {
        consistent_parameters(robot, problem, sigma, settings)
    } else {
        nearest_consistent_parameters(robot, problem, sigma, settings, &estimate.values)
    }
}
