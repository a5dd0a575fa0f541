//! Nearest friction over a recorded motion, and error bars of simulator parameters.

use super::common::tree;
use dynident_export::{
    ComparedOver, DriveKnowledge, NearestFriction, RecordedVelocity, RobotModel, SIMULATOR_SCHEMA, SimulatorFile,
    SimulatorValue,
};
use dynident_model::terms::{Coulomb, CoulombShape, DriveInertia, MaxwellSlip, Offset, Stribeck, TorqueTerm, Viscous};

const SIGN: CoulombShape = CoulombShape::Sign { dead_band: 0.0 };

fn coulomb() -> TorqueTerm {
    TorqueTerm::Coulomb(Coulomb { joint: 0, shape: SIGN })
}

fn stribeck() -> TorqueTerm {
    TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.5, exponent: 1.0, shape: SIGN })
}

fn viscous() -> TorqueTerm {
    TorqueTerm::Viscous(Viscous { joint: 0 })
}

/// The tree with drives at joint 0, which was recorded at `velocities`.
fn robot(terms: Vec<TorqueTerm>, values: &[f64], velocities: &[(f64, f64)]) -> RobotModel {
    let model = tree().model().clone();
    let mut recorded = vec![Vec::new(); model.dof()];
    let one = |&(velocity, samples): &(f64, f64)| RecordedVelocity { velocity, samples };
    recorded[0] = velocities.iter().map(one).collect();
    RobotModel::new(model, terms, values.to_vec()).unwrap().with_velocities(recorded).unwrap()
}

#[test]
fn nearest_friction_fits_two_recorded_speeds() {
    let law = |v: f64| 2.0 + 3.0 * (-v / 0.5).exp() + 0.4 * v;
    let motion = [(0.1, 50.0), (-0.1, 7.0), (1.5, 3.0), (-1.5, 900.0)];
    let robot = robot(vec![coulomb(), stribeck(), viscous()], &[2.0, 3.0, 4.0], &motion);
    // Friction decreases between the two velocities: the best damping would be negative without strong viscous
    // friction.
    let law = |v: f64| law(v) + 3.6 * v;
    let viscous = (law(1.5) - law(0.1)) / 1.4;
    let found = NearestFriction::of(&robot, 0);
    // Tolerance: rounding error of two unknowns from two points.
    assert!((found.viscous - viscous).abs() < 1e-12 && (found.coulomb - (law(0.1) - 0.1 * viscous)).abs() < 1e-12);
    assert!(found.most_error < 1e-12, "{found:?}");
    assert_eq!((found.over, found.most_speed), (ComparedOver::RecordedMotion, 1.5));
    assert_eq!(NearestFriction::of(&robot, 1).over, ComparedOver::VelocityLimit);
}

#[test]
fn samples_weigh() {
    // An offset is assigned to Coulomb friction according to the share of samples in each direction.
    let offset = || vec![TorqueTerm::Offset(Offset { joint: 0 })];
    let found = NearestFriction::of(&robot(offset(), &[1.0], &[(1.0, 3.0), (-1.0, 1.0)]), 0);
    // One speed does not determine damping. (3 - 1) / 4 of the offset; squares of 1/2 three times and of 3/2 once.
    assert_eq!((found.coulomb, found.viscous), (0.5, 0.0));
    assert!((found.rms_error - (3.0_f64 / 4.0).sqrt()).abs() < 1e-15 && found.most_error == 1.5, "{found:?}");
    let against = NearestFriction::of(&robot(offset(), &[1.0], &[(1.0, 1.0), (-1.0, 3.0)]), 0);
    assert_eq!((against.coulomb, against.viscous), (0.0, 0.0));
}

#[test]
fn maxwell_slip_is_approximated_by_coulomb_friction() {
    let slip = TorqueTerm::MaxwellSlip(MaxwellSlip { joint: 0, yield_displacement: 0.01 });
    let found = NearestFriction::of(&robot(vec![slip, viscous()], &[1.5, 0.2], &[(0.2, 1.0), (-0.9, 2.0)]), 0);
    assert!((found.coulomb - 1.5).abs() < 1e-12 && (found.viscous - 0.2).abs() < 1e-12, "{found:?}");
}

#[test]
fn shares_are_derivatives() {
    let motion: Vec<(f64, f64)> = (1..40).map(|k| (0.05 * f64::from(k) - 0.73, 1.0 + f64::from(k % 5))).collect();
    // On both sides of the boundary: with 0.3 of viscous friction the best damping is zero.
    for strength in [4.0, 0.3] {
        let values = [2.0, 3.0, strength];
        let with = |values: &[f64]| robot(vec![coulomb(), stribeck(), viscous()], values, &motion);
        let shares = NearestFriction::shares(&with(&values), 0);
        assert_eq!(shares.iter().map(|share| share.term).collect::<Vec<_>>(), [0, 1, 2]);
        for share in shares {
            let moved = |step: f64| {
                let mut values = values;
                values[share.term] += step;
                NearestFriction::of(&with(&values), 0)
            };
            let (above, below) = (moved(0.01), moved(-0.01));
            // The dependence is linear, so the difference quotient is exact except for rounding times 1e2.
            assert!((share.coulomb - 50.0 * (above.coulomb - below.coulomb)).abs() < 1e-10, "{share:?}");
            assert!((share.viscous - 50.0 * (above.viscous - below.viscous)).abs() < 1e-10, "{share:?}");
        }
    }
}

fn knowledge(products: Vec<Vec<Option<f64>>>, dof: usize) -> DriveKnowledge {
    let gain = SimulatorValue { value: 1.0, half_width_95: None, unit: "Nm per unit logged".to_owned(), note: None };
    DriveKnowledge {
        term_notes: vec![None; products.len()],
        term_products: products,
        common_delay: None,
        delays: vec![None; dof],
        actuator_gains: vec![gain; dof],
    }
}

#[test]
fn bars_follow_from_the_covariance() {
    let terms = vec![coulomb(), stribeck(), viscous(), TorqueTerm::DriveInertia(DriveInertia { joint: 0 })];
    let motion = [(0.1, 1.0), (-0.1, 1.0), (1.5, 1.0), (-1.5, 1.0)];
    let robot = robot(terms, &[2.0, 3.0, 4.0, 0.7], &motion);
    let covariance =
        [[0.04, -0.02, 0.01, 0.0], [-0.02, 0.09, -0.03, 0.0], [0.01, -0.03, 0.05, 0.0], [0.0, 0.0, 0.0, 0.25]];
    let products = covariance.map(|row| row.map(Some).to_vec()).to_vec();
    let dof = robot.model().dof();
    let file = SimulatorFile::of(&robot, &knowledge(products.clone(), dof), &[]).unwrap();
    assert_eq!((file.schema.as_str(), file.joints.len()), (SIMULATOR_SCHEMA, dof));
    let joint = &file.joints[0];
    // Expected line through two points: the Stribeck term decreases from e^-0.2 to e^-3.
    let (low, high) = ((-0.2_f64).exp(), (-3.0_f64).exp());
    let slope = (high - low) / 1.4;
    let of = |a: [f64; 4]| {
        let product = |i: usize, j: usize| a[i] * a[j] * covariance[i][j];
        (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).map(|(i, j)| product(i, j)).sum::<f64>().sqrt()
    };
    let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
    assert!(near(joint.damping.half_width_95, of([0.0, slope, 1.0, 0.0])), "{:?}", joint.damping);
    assert!(near(joint.frictionloss.half_width_95, of([1.0, low - 0.1 * slope, 0.0, 0.0])), "{:?}", joint.frictionloss);
    assert_eq!((joint.armature.value, joint.armature.half_width_95), (0.7, Some(0.5)));

    // A term without an individual interval gets the error bar of its combination, with a reason.
    let mut unknown = knowledge(products, dof);
    for k in 0..4 {
        unknown.term_products[1][k] = None;
        unknown.term_products[k][1] = None;
    }
    unknown.term_notes[1] = Some("not excited".to_owned());
    let file = SimulatorFile::of(&robot, &unknown, &["A note.".to_owned()]).unwrap();
    let (damping, armature) = (&file.joints[0].damping, &file.joints[0].armature);
    assert_eq!((damping.half_width_95, damping.note.as_deref()), (None, Some("not excited")));
    assert_eq!((armature.half_width_95, armature.note.as_deref()), (Some(0.5), None));
    let table = file.table().text;
    for said in ["0.70 ± 0.50 kg m^2", "± ? Nm s/rad", "turn, damping: not excited", "- A note."] {
        assert!(table.contains(said), "{said}: {table}");
    }
    let back: SimulatorFile = serde_json::from_str(&file.json().unwrap().text).unwrap();
    assert_eq!(back, file);
}

#[test]
fn knowledge_of_another_robot_is_refused() {
    let robot = robot(vec![viscous()], &[1.0], &[]);
    let error = SimulatorFile::of(&robot, &knowledge(Vec::new(), robot.model().dof()), &[]).unwrap_err();
    assert_eq!(error.to_string(), "0 values for 1 torque terms: give one for each");
    let zero = vec![vec![RecordedVelocity { velocity: 0.0, samples: 1.0 }]; robot.model().dof()];
    assert!(
        robot
            .clone()
            .with_velocities(zero)
            .unwrap_err()
            .to_string()
            .contains("joint `turn`: 1 samples of the velocity 0")
    );
    assert!(robot.with_velocities(Vec::new()).unwrap_err().to_string().contains("of 0 joints for 4"));
}
