//! Assumed uncertainty of the values of a robot description.

use super::problem::{MASS_STD_RATIO, consistent_body, reference_bodies, term_sizes};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::LinearProblem;
use dynident_model::{INERTIAL_NAMES, InertialParameters};
use nalgebra::{DMatrix, Matrix4};

/// Standard deviation of a friction or drive parameter, relative to the value with which the term alone would explain
/// the torque of its joint.
const TERM_STD_RATIO: f64 = 0.5;

/// Covariance matrix of the base parameters of the robot description, for values that the data do not determine.
///
/// The true pseudo-inertia J of a body is assumed to be `J_0 + ρ J_0^½ X J_0^½` with the described pseudo-inertia J_0
/// and ρ = 0.3. X is a symmetric matrix of Gaussian variables with variance 1 on the diagonal and 1/2 elsewhere. In any
/// frame and units, this gives standard deviations of 30 % of the mass, 30 % of the inertia, and 30 % of the body's
/// extent for the centre of mass. The standard deviation of a friction or drive parameter combines 30 % of its value
/// and half of the value with which it alone would explain the torque of its joint, because friction is hardly known in
/// advance.
pub fn nominal_covariance(
    robot: &ParametricModel,
    problem: &LinearProblem,
    settings: &ConsistencySettings,
) -> DMatrix<f64> {
    let (base, bodies) = (robot.base(), robot.model().inertial_count());
    let mut directions = usual_errors_of_bodies(robot, settings, 0.0);
    for (place, spread) in term_spreads(robot, problem).into_iter().enumerate() {
        directions.push(of_column(robot, bodies + place).iter().map(|x| x * spread).collect());
    }
    let spread = DMatrix::from_fn(base.count(), directions.len(), |row, column| directions[column][row]);
    &spread * spread.transpose()
}

/// Changes of the base parameters for independent errors of one standard deviation, ten for each body whose parameters
/// are not known. These are the errors of [`nominal_covariance`], without friction and drive parameters.
///
/// `thicker` is a thickness that is added to each body in all directions, relative to its extent, because rods and
/// plates of a description also have errors in their thin directions.
pub fn usual_errors_of_bodies(robot: &ParametricModel, settings: &ConsistencySettings, thicker: f64) -> Vec<Vec<f64>> {
    let references = reference_bodies(robot, settings);
    let mut directions: Vec<Vec<f64>> = Vec::new();
    for (index, body) in references.iter().enumerate() {
        let known = settings.bodies.get(robot.model().bodies()[index].name()).is_some_and(|own| own.known.is_some());
        if known {
            continue;
        }
        let columns: Vec<Vec<f64>> = (0..10).map(|k| of_column(robot, 10 * index + k)).collect();
        for direction in body_directions(body, thicker) {
            let sum = |row: usize| (0..10).map(|k| columns[k][row] * direction[k]).sum();
            directions.push((0..robot.base().count()).map(sum).collect());
        }
    }
    directions
}

/// Changes of all inertial parameters for independent errors with a relative standard deviation of 1, eleven for each
/// body. Ten are the directions of [`nominal_covariance`] divided by its 30 %. The eleventh is the distance of the
/// centre of mass from the joint: links are nearly symmetric about their length, but the position of a motor along the
/// link may be wrong by a large part of its size. `None` if the nominal values of a body
/// are inconsistent.
pub(crate) fn body_spread(robot: &ParametricModel, settings: &ConsistencySettings) -> Option<DMatrix<f64>> {
    let bodies = robot.model().bodies();
    if !robot.nominal()[..10 * bodies.len()].chunks_exact(10).all(|body| consistent_body(body).0) {
        return None;
    }
    let mut spread = DMatrix::zeros(10 * bodies.len(), 11 * bodies.len());
    for (index, body) in reference_bodies(robot, settings).iter().enumerate() {
        let of_shape = body_directions(body, 0.0).into_iter().map(|own| own.map(|value| value / MASS_STD_RATIO));
        for (k, direction) in of_shape.chain([along_link(body)]).enumerate() {
            for (row, value) in direction.iter().enumerate() {
                spread[(10 * index + row, 11 * index + k)] = *value;
            }
        }
    }
    Some(spread)
}

/// The base parameters for a unit value of one parameter and zero for all others.
fn of_column(robot: &ParametricModel, column: usize) -> Vec<f64> {
    let mut values = vec![0.0; robot.model().inertial_count() + robot.terms().len()];
    values[column] = 1.0;
    robot.base().values(&values)
}

/// Standard deviation of the nominal value of each friction or drive parameter.
pub(super) fn term_spreads(robot: &ParametricModel, problem: &LinearProblem) -> Vec<f64> {
    let values = &robot.nominal()[robot.model().inertial_count()..];
    let sizes = term_sizes(robot, problem, 1.0);
    values.iter().zip(sizes).map(|(value, size)| (MASS_STD_RATIO * value).hypot(TERM_STD_RATIO * size)).collect()
}

/// Ten inertial parameters of `ρ J^½ S J^½` for each of ten symmetric matrices S of unit norm, where J is the
/// pseudo-inertia of a body with added thickness.
fn body_directions(body: &[f64; 10], thicker: f64) -> Vec<[f64; 10]> {
    let mut pseudo = InertialParameters(*body).pseudo_inertia();
    let of_point = InertialParameters(*body).com_m().map_or(0.0, |com| body[0] * com.dot(com));
    let about_com = ((0..3).map(|k| pseudo[(k, k)]).sum::<f64>() - of_point).max(0.0);
    (0..3).for_each(|k| pseudo[(k, k)] += thicker.powi(2) * about_com);
    let eigen = pseudo.symmetric_eigen();
    let root = eigen.eigenvectors
        * Matrix4::from_diagonal(&eigen.eigenvalues.map(|value| value.max(0.0).sqrt()))
        * eigen.eigenvectors.transpose();
    let pairs = (0..4).flat_map(|a| (a..4).map(move |b| (a, b)));
    pairs
        .map(|(a, b)| {
            let mut symmetric = Matrix4::zeros();
            let entry = if a == b { MASS_STD_RATIO } else { MASS_STD_RATIO * core::f64::consts::FRAC_1_SQRT_2 };
            (symmetric[(a, b)], symmetric[(b, a)]) = (entry, entry);
            parameters_of(&(root * symmetric * root))
        })
        .collect()
}

/// Derivative of the ten parameters by a factor on the distance of the centre of mass from the origin, for constant
/// mass and constant inertia about the centre of mass. The parameters are quadratic in this factor, so a central
/// difference is exact.
fn along_link(body: &[f64; 10]) -> [f64; 10] {
    let own = InertialParameters(*body);
    let (Some(centre), Some(inertia)) = (own.com_m(), own.inertia_at_com()) else { return [0.0; 10] };
    let [above, below] =
        [2.0, 0.0].map(|factor| InertialParameters::from_centre_of_mass(body[0], centre.scale(factor), &inertia).0);
    core::array::from_fn(|k| 0.5 * (above[k] - below[k]))
}

/// The ten parameters of a pseudo-inertia.
fn parameters_of(pseudo: &Matrix4<f64>) -> [f64; 10] {
    let trace = pseudo[(0, 0)] + pseudo[(1, 1)] + pseudo[(2, 2)];
    let axes = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
    let mut own = [0.0; INERTIAL_NAMES.len()];
    own[0] = pseudo[(3, 3)];
    for k in 0..3 {
        own[1 + k] = pseudo[(3, k)];
    }
    for (k, (a, b)) in axes.into_iter().enumerate() {
        own[4 + k] = (if a == b { trace } else { 0.0 }) - pseudo[(a, b)];
    }
    own
}
