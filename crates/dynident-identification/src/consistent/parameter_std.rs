//! Error bars of all parameters of the physically consistent set, from data and robot description.

use super::error::ConsistencyError;
use super::nominal_spread::term_spreads;
use super::problem::{MASS_STD_RATIO, consistent_body, described_problem};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::{MassPrior, expected_error};
use dynident_estimation::{Estimate, LinearProblem};
use dynident_model::Body;

/// Standard deviation of every parameter of the physically consistent set, ten for each body and one for each friction
/// or drive term. It is the [`expected_error`] for the covariance of the estimate and the covariance of the description
/// ([`nominal_covariance`](super::nominal_covariance)). Identifiable values get the error bar of the data; an
/// unidentifiable mass gets 30 %. `None` for bodies with a missing or inconsistent description: their prior is a rough
/// body, so only their base parameters are meaningful.
///
/// # Errors
/// As [`consistent_parameters`](super::consistent_parameters).
pub fn parameter_std(
    robot: &ParametricModel,
    problem: &LinearProblem,
    estimate: &Estimate,
    settings: &ConsistencySettings,
) -> Result<Vec<Option<f64>>, ConsistencyError> {
    let physical = described_problem(robot, problem, &estimate.joint_sigma, settings)?;
    let belief = MassPrior { body_share: MASS_STD_RATIO, scalar_std: term_spreads(robot, problem) };
    let count = robot.base().count();
    let covariance = estimate.covariance.view((0, 0), (count, count)).into_owned();
    let std = expected_error(&physical, &settings.fit(), &covariance, &belief)?;
    let is_described = |(index, body): (usize, &Body)| {
        let own = settings.bodies.get(body.name());
        let is_stated = own.is_some_and(|own| own.prior.is_some() || own.known.is_some());
        let nominal = &robot.nominal()[10 * index..10 * index + 10];
        is_stated || (body.prior().is_some() && consistent_body(nominal).0)
    };
    let described: Vec<bool> = robot.model().bodies().iter().enumerate().map(is_described).collect();
    let of = |(index, std): (usize, f64)| described.get(index / 10).is_none_or(|&described| described).then_some(std);
    Ok(std.into_iter().enumerate().map(of).collect())
}
