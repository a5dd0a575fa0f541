//! The physically consistent fit of all bodies and terms to the rows of an estimate.

use super::error::ConsistencyError;
use super::settings::{BodyKnowledge, ConsistencySettings, EllipsoidSettings};
use dynident_dynamics::ParametricModel;
use dynident_estimation::consistent::{
    BaseMap, BodyPrior, Ellipsoid, PhysicalBody, PhysicalFit, PhysicalProblem, PhysicalScalar, physical_fit, rough_body,
};
use dynident_estimation::{LinearProblem, RankSettings};
use dynident_model::terms::TorqueTerm;
use dynident_model::{Body, InertialParameters, Model};

/// Minimum noise of a joint relative to the root mean square of its torque. With noise-free simulated torque, the prior
/// would otherwise be lost in rounding errors.
const MIN_RELATIVE_NOISE: f64 = 1.0e-4;

/// Standard deviation of a mass in the robot description, relative to the mass.
pub(super) const MASS_STD_RATIO: f64 = 0.3;

/// Size of an unexcited friction or drive parameter relative to its joint's torque. It is so small that the barrier of
/// the interior-point method does not move the parameter.
const UNEXCITED_SIZE_RATIO: f64 = 1.0e-4;

/// Share of an approximate body that is added to each nominal body, because rods and plates have no extent in some
/// direction.
const ROUGH_BODY_SHARE: f64 = 1.0e-2;

/// The best physically consistent fit to the rows of an estimate. `joint_sigma` is the standard deviation of the noise
/// of each joint, Nm. See [`physical_fit`].
///
/// # Errors
/// Contradictory limits, an inconsistent prior body, unknown names, values that are not finite.
pub fn consistent_parameters(
    robot: &ParametricModel,
    problem: &LinearProblem,
    joint_sigma: &[f64],
    settings: &ConsistencySettings,
) -> Result<PhysicalFit, ConsistencyError> {
    Ok(physical_fit(&described_problem(robot, problem, joint_sigma, settings)?, &settings.fit())?)
}

/// Problem of [`consistency_problem`] with the masses of the robot description as priors.
pub(super) fn described_problem(
    robot: &ParametricModel,
    problem: &LinearProblem,
    joint_sigma: &[f64],
    settings: &ConsistencySettings,
) -> Result<PhysicalProblem, ConsistencyError> {
    let problem = consistency_problem(robot, problem, joint_sigma, settings)?;
    Ok(problem.with_mass_beliefs(mass_beliefs(robot, settings))?.with_body_priors(body_priors(robot, settings))?)
}

/// The physically consistent parameters whose torque on these rows differs least from the torque of the base parameters
/// `theta`. For estimates that are not the least-squares solution of these rows.
///
/// # Errors
/// As [`consistent_parameters`].
pub fn nearest_consistent_parameters(
    robot: &ParametricModel,
    problem: &LinearProblem,
    joint_sigma: &[f64],
    settings: &ConsistencySettings,
    theta: &[f64],
) -> Result<PhysicalFit, ConsistencyError> {
    let around = described_problem(robot, problem, joint_sigma, settings)?.around(theta)?;
    Ok(physical_fit(&around, &settings.fit())?)
}

/// Masses in the robot description, kg, with their standard deviations; `None` for bodies that the settings define.
fn mass_beliefs(robot: &ParametricModel, settings: &ConsistencySettings) -> Vec<Option<[f64; 2]>> {
    let belief = |(index, body): (usize, &Body)| {
        let own = &robot.nominal()[10 * index..10 * index + 10];
        let is_stated = |own: &BodyKnowledge| own.prior.is_some() || own.known.is_some() || own.prior_std.is_some();
        let is_stated = settings.bodies.get(body.name()).is_some_and(is_stated);
        (body.prior().is_some() && !is_stated && consistent_body(own).0).then(|| [own[0], MASS_STD_RATIO * own[0]])
    };
    robot.model().bodies().iter().enumerate().map(belief).collect()
}

/// Prior bodies for which the settings state a standard deviation.
fn body_priors(robot: &ParametricModel, settings: &ConsistencySettings) -> Vec<Option<BodyPrior>> {
    let prior = |(index, body): (usize, &Body)| {
        let own = settings.bodies.get(body.name())?;
        let nominal = core::array::from_fn(|k| robot.nominal()[10 * index + k]);
        let parameters = own.prior.or_else(|| consistent_body(&nominal).0.then_some(nominal))?;
        own.prior_std.map(|share| BodyPrior { parameters, share })
    };
    robot.model().bodies().iter().enumerate().map(prior).collect()
}

/// Bodies whose inertia in the robot description is not physically consistent, unless the settings define them: their
/// names, and the smallest eigenvalue of the pseudo-inertia, kg m². The prior of such a body is an approximate body.
pub fn inconsistent_nominal_bodies(robot: &ParametricModel, settings: &ConsistencySettings) -> Vec<(String, f64)> {
    let bodies = robot.model().bodies().iter().enumerate();
    let stated = bodies.filter(|(_, body)| {
        let own = settings.bodies.get(body.name());
        body.prior().is_some() && own.is_none_or(|own| own.prior.is_none() && own.known.is_none())
    });
    stated
        .filter_map(|(index, body)| {
            let (consistent, least) = consistent_body(&robot.nominal()[10 * index..10 * index + 10]);
            (!consistent).then(|| (body.name().to_owned(), least))
        })
        .collect()
}

/// Whether ten parameters are physically consistent (thin plates are allowed), and the smallest eigenvalue of their
/// pseudo-inertia.
pub(crate) fn consistent_body(own: &[f64]) -> (bool, f64) {
    let stated = InertialParameters(core::array::from_fn(|k| own[k]));
    let least = stated.pseudo_inertia().symmetric_eigenvalues().min();
    let moments = stated.inertia_at_origin();
    let rounding = 1.0e-9 * (0..3).map(|k| moments.0[k][k].abs()).sum::<f64>() + 1.0e-15 * stated.mass_kg();
    (stated.mass_kg() > 0.0 && least >= -rounding, least)
}

/// The optimisation problem that [`consistent_parameters`] solves, without the masses of the robot description as
/// priors.
///
/// # Errors
/// As [`consistent_parameters`].
pub fn consistency_problem(
    robot: &ParametricModel,
    problem: &LinearProblem,
    joint_sigma: &[f64],
    settings: &ConsistencySettings,
) -> Result<PhysicalProblem, ConsistencyError> {
    let (model, terms, base, prior) = (robot.model(), robot.terms(), robot.base(), robot.nominal());
    settings.check_names(model, terms)?;
    let mut squares = vec![0.0; problem.joints().len()];
    for equation in problem.equations() {
        squares[equation.joint] += equation.factor.total().torque_norm().powi(2);
    }
    let rows = problem.joint_rows();
    let weights: Vec<f64> = joint_sigma
        .iter()
        .zip(squares.iter().zip(&rows))
        .map(|(sigma, (square, &rows))| {
            let least = MIN_RELATIVE_NOISE * (square / rows.max(1) as f64).sqrt();
            let sigma = sigma.max(least);
            if sigma > 0.0 { 1.0 / sigma } else { 1.0 }
        })
        .collect();
    let factor = problem.combined_without_noise(&weights, &RankSettings::default())?;
    let map = BaseMap::from_regrouping(base.independent(), base.dependent(), base.regrouping())?;
    let (length, mean_mass) = (typical_length_m(model), mean_mass(robot));
    let references = reference_bodies(robot, settings);
    let bodies = model.bodies().iter().zip(references).map(|(body, reference)| {
        let knowledge = settings.bodies.get(body.name()).cloned().unwrap_or_default();
        let inside = |ellipsoid: EllipsoidSettings| Ellipsoid {
            centre_m: ellipsoid.centre_m,
            semi_axes_m: ellipsoid.semi_axes_m,
        };
        PhysicalBody {
            name: body.name().to_owned(),
            reference,
            known: knowledge.known,
            mass_kg: knowledge.mass_kg,
            com_box_m: knowledge.com_box_m,
            inside: knowledge.inside.map(inside),
        }
    });
    let sizes = term_sizes(robot, problem, UNEXCITED_SIZE_RATIO);
    let scalars = terms.iter().zip(&prior[model.inertial_count()..]).zip(sizes).map(|((term, &value), size)| {
        let bounded = term.is_nonnegative();
        let own = settings.terms.get(&term.symbol());
        let scale = if term.is_drive_inertia() { mean_mass * length * length } else { size };
        let lower = own.map(|limits| limits[0]);
        PhysicalScalar {
            name: term.symbol(),
            lower: if bounded { Some(lower.unwrap_or(0.0).max(0.0)) } else { lower },
            upper: own.map(|limits| limits[1]),
            prior: if bounded { value.max(0.0) } else { value },
            scale,
        }
    });
    let described = PhysicalProblem::new(map, bodies.collect(), scalars.collect(), &factor)?;
    match settings.total_mass_kg {
        Some(limits) => Ok(described.with_total_mass_kg(limits)?),
        None => Ok(described),
    }
}

/// Prior body of each body: the body in the settings, the nominal body with a small share of an approximate body, or
/// only an approximate body.
pub(super) fn reference_bodies(robot: &ParametricModel, settings: &ConsistencySettings) -> Vec<[f64; 10]> {
    let (length, mean_mass) = (typical_length_m(robot.model()), mean_mass(robot));
    let reference = |(index, body): (usize, &Body)| {
        let own = &robot.nominal()[10 * index..10 * index + 10];
        settings.bodies.get(body.name()).and_then(|knowledge| knowledge.prior).unwrap_or_else(|| {
            if consistent_body(own).0 {
                let rough = rough_body(own[0], length);
                core::array::from_fn(|k| own[k] + ROUGH_BODY_SHARE * rough[k])
            } else {
                rough_body(mean_mass, length)
            }
        })
    };
    robot.model().bodies().iter().enumerate().map(reference).collect()
}

/// Mean of the masses in the robot description, kg; 1 if it contains none.
fn mean_mass(robot: &ParametricModel) -> f64 {
    let masses = (0..robot.model().body_count()).map(|body| robot.nominal()[10 * body]).filter(|&mass| mass > 0.0);
    let masses: Vec<f64> = masses.collect();
    if masses.is_empty() { 1.0 } else { masses.iter().sum::<f64>() / masses.len() as f64 }
}

/// For each friction or drive term, the value with which the term alone would explain the torque of its joint:
/// `‖τ_j‖ / ‖w‖` over all rows of joint j, with torque τ_j and column w of the term. This scale suits robots of any
/// size and any units. It is 1 for a term without a column in the data. For an unexcited term, whose column contains
/// only noise, it is `silent` times the root mean square of the joint's torque.
pub(super) fn term_sizes(robot: &ParametricModel, problem: &LinearProblem, silent: f64) -> Vec<f64> {
    let first = robot.model().inertial_count();
    let size = |(index, _): (usize, &TorqueTerm)| {
        let column = robot.base().independent().iter().position(|&independent| independent == first + index)?;
        let (mut torque, mut norm) = (0.0, 0.0);
        let is_silent = problem.unexcited().silent.contains(&column);
        for equation in problem.equations() {
            let Some(place) = equation.columns.iter().position(|&own| own == column) else { continue };
            let factor = equation.factor.total();
            let own = factor.column_norms()[place];
            if own > 0.0 {
                torque += factor.torque_norm().powi(2);
                norm += if is_silent { factor.rows() as f64 / (silent * silent) } else { own * own };
            }
        }
        let size = (torque / norm).sqrt();
        (size.is_finite() && size > 0.0).then_some(size)
    };
    robot.terms().iter().enumerate().map(|term| size(term).unwrap_or(1.0)).collect()
}

/// Typical length of the robot's links, m: the mean distance between successive joints. If all axes meet in one point,
/// it is the mean distance of the nominal centres of mass from their joints, or 1 without nominal centres of mass.
pub fn typical_length_m(model: &Model) -> f64 {
    let mean = |lengths: Vec<f64>| {
        let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
        (mean > 0.0).then_some(mean)
    };
    let joints = model.tree_joints().iter().map(|joint| joint.placement.translation.norm());
    let centres = model.inertials().iter().filter_map(|body| Some(body.com_m()?.norm()));
    mean(joints.collect()).or_else(|| mean(centres.collect())).unwrap_or(1.0)
}
