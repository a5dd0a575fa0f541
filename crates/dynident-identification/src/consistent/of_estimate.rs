//! Consistent parameters for any estimate.

use super::error::ConsistencyError;
use super::problem::{consistent_parameters, nearest_consistent_parameters};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::PhysicalFit;
use dynident_estimation::{Estimate, LinearProblem};

/// The best consistent fit to the factors of the estimate; if the estimate is not their least-squares solution (`plain`
/// is false), the consistent parameters that are nearest to it in the metric of the factors.
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
