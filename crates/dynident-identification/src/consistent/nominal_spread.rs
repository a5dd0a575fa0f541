//! How far a description's values may be from the truth, where it does not say.

use super::problem::{MASS_SHARE, reference_bodies, term_sizes};
use super::settings::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use dynident_estimation::LinearProblem;
use dynident_model::{INERTIAL_NAMES, InertialParameters};
use nalgebra::{DMatrix, Matrix4};

/// Standard deviation of a term of which nothing is known, as a share of the value with which it alone would make the
/// torque of its joint.
const TERM_SHARE: f64 = 0.5;

/// Covariance of the description's base parameters, (base, base): what is to be expected of a value that the data do
/// not tell and that stays at nominal.
///
/// A body's pseudo-inertia J is `J_0 + ρ J_0^½ X J_0^½` with X symmetric and Gaussian of unit variance (half that off
/// the diagonal) and ρ the 0.3 that masses have: the mass is right within 30 %, the centre of mass and the inertia
/// within 30 % of the body's extent and of its inertia, in whatever frame and units. Torque terms are right within 30 %
/// of their value and half of what the torque of their joint allows for: little is known of friction beforehand.
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

/// The base parameters that independent errors of one standard deviation make, ten of each body that is not known:
/// those of [`nominal_covariance`] without terms.
///
/// Each body is taken for this share of its extent `thicker` than described, in all directions: those of rods and
/// plates err across them as well.
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

/// The base parameters that one parameter of a body or of a term makes.
fn of_column(robot: &ParametricModel, column: usize) -> Vec<f64> {
    let mut values = vec![0.0; robot.model().inertial_count() + robot.terms().len()];
    values[column] = 1.0;
    robot.base().values(&values)
}

/// How far the nominal value of each torque term may be wrong: 30 % of it, and half of what its joint's torque allows.
pub(super) fn term_spreads(robot: &ParametricModel, problem: &LinearProblem) -> Vec<f64> {
    let values = &robot.nominal()[robot.model().inertial_count()..];
    let sizes = term_sizes(robot, problem, 1.0);
    values.iter().zip(sizes).map(|(value, size)| (MASS_SHARE * value).hypot(TERM_SHARE * size)).collect()
}

/// ρ J^½ S J^½ as ten parameters, for the ten symmetric S of unit norm, of a body that is by a share of its extent
/// thicker.
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
            let entry = if a == b { MASS_SHARE } else { MASS_SHARE * core::f64::consts::FRAC_1_SQRT_2 };
            (symmetric[(a, b)], symmetric[(b, a)]) = (entry, entry);
            parameters_of(&(root * symmetric * root))
        })
        .collect()
}

/// The ten parameters whose pseudo-inertia this is.
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
