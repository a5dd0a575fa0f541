//! From any estimate to consistent parameters.

use super::error::ConsistencyError;
use super::problem::{consistent_parameters, nearest_consistent_parameters};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::PhysicalFit;
use dynident_estimation::{Estimate, LinearProblem};

/// The consistent parameters that fit the logs best, from the factors that the estimate was made from; or, where it is
/// not the least squares of these factors (`plain` is false), those nearest to the estimate in the metric of the
/// factors.
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
