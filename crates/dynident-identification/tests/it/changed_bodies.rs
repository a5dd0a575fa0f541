//! Bodies that differ from the description: one, two, all or none.

use dynident_dynamics::ParametricModel;
use dynident_identification::DescriptionThresholds;
use dynident_identification::changes::Differences;
use dynident_identification::consistent::ConsistencySettings;
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Mat3, Vec3};
use nalgebra::{DMatrix, DVector};

/// Standard deviations of the base parameters of each body of a Panda after a minute of motion, kg m and kg m².
const STD: [f64; 7] = [1e-3, 1e-3, 1e-3, 1e-3, 2e-4, 1e-4, 3e-5];
/// True errors relative to the error bars: bars for correlated residuals are often too wide.
const ERROR_SHARE: f64 = 0.6;

/// The bodies that the written model changes, for a Panda whose bodies changed.
fn named_bodies(change: impl Fn(usize, &InertialParameters) -> InertialParameters, seed: u64) -> Vec<usize> {
    let file = dynident_testing::repository("robots/panda_arm7.urdf");
    let model = dynident_model::load_robot(file).unwrap().model;
    let robot = ParametricModel::new(model, Vec::new()).unwrap();
    let bodies = robot.model().inertials().iter().enumerate();
    let changed: Vec<f64> = bodies.flat_map(|(body, own)| change(body, own).0).collect();
    let truth = robot.base().values(&changed);
    let rows: Vec<usize> = (0..robot.base().count()).collect();
    let std = |row: usize| STD[robot.base().independent()[row] / 10];
    let mut random = Random::new(seed);
    let values = DVector::from_fn(rows.len(), |row, _| truth[row] + ERROR_SHARE * std(row) * random.normal());
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| if a == b { std(a).powi(2) } else { 0.0 });
    let knowledge = ConsistencySettings::default();
    let limits = DescriptionThresholds::default();
    let found = Differences::from_description(&robot, &rows, &values, &covariance, &knowledge, &limits);
    let found = found.unwrap().unwrap();
    found.followed(&limits).map_or_else(Vec::new, |own| found.bodies_of(own))
}

fn load(mass_kg: f64, at: [f64; 3]) -> InertialParameters {
    let inertia = Mat3::IDENTITY.scale(0.4 * mass_kg * 0.04_f64.powi(2));
    InertialParameters::from_centre_of_mass(mass_kg, Vec3(at), &inertia)
}

/// A load near the centre of mass of its body resembles a common factor of the values of this body, so a factor of
/// every body once explained two changes better.
#[test]
fn two_changed_bodies_of_an_arm_with_seven_axes_are_named() {
    for seed in 0..4 {
        let two_loads = |body: usize, own: &InertialParameters| match body {
            3 => own.plus(&load(1.0, [0.0, 0.05, 0.0])),
            6 => own.plus(&load(1.5, [0.0, 0.0, 0.1])),
            _ => *own,
        };
        assert_eq!(named_bodies(two_loads, seed), [3, 6], "{seed}");
    }
}

/// The heavier link is a common factor, so a factor of every body is nearly as probable: the evidence is sometimes too
/// weak to name bodies, but never names others.
#[test]
fn a_load_and_a_heavier_link_are_named() {
    let mut named = 0;
    for seed in 0..6 {
        let change = |body: usize, own: &InertialParameters| match body {
            4 => InertialParameters(own.0.map(|value| 1.5 * value)),
            6 => own.plus(&load(0.7, [0.0, 0.0, 0.1])),
            _ => *own,
        };
        let bodies = named_bodies(change, seed);
        assert!(bodies.is_empty() || bodies == [4, 6], "{seed}: {bodies:?}");
        named += usize::from(!bodies.is_empty());
    }
    assert!(named >= 4, "{named} of 6");
}

#[test]
fn no_body_is_named_if_none_or_all_changed() {
    for seed in 0..10 {
        assert_eq!(named_bodies(|_, own| *own, seed), Vec::<usize>::new(), "{seed}");
        let factors: Vec<f64> = {
            let mut random = Random::new(100 + seed);
            (0..7).map(|_| 1.0 + 0.2 * random.uniform(-1.0, 1.0)).collect()
        };
        let every =
            |body: usize, own: &InertialParameters| InertialParameters(own.0.map(|value| factors[body] * value));
        assert_eq!(named_bodies(every, seed), Vec::<usize>::new(), "{seed}: {factors:?}");
    }
}
