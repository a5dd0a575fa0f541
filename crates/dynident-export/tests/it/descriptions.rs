//! MJCF and URDF. `.ci/export.py` shows that MuJoCo reads the MJCF and gives the same motion as the model.

use super::common::{all_terms, tree};
use dynident_export::{NearestFriction, RobotModel, Target, export};
use dynident_model::read_urdf;
use dynident_model::terms::{Coulomb, CoulombShape, Offset, Stribeck, TorqueTerm, Viscous};

#[test]
fn simulator_friction_is_reproduced_exactly() {
    let model = tree().model().clone();
    let coulomb = TorqueTerm::Coulomb(Coulomb { joint: 0, shape: CoulombShape::Sign { dead_band: 0.0 } });
    let terms = vec![coulomb, TorqueTerm::Viscous(Viscous { joint: 0 })];
    let robot = RobotModel::new(model, terms, vec![3.0, 0.7]).unwrap();
    let found = NearestFriction::of(&robot, 0);
    // Tolerance: rounding error of exact data with two unknowns.
    assert!((found.coulomb - 3.0).abs() < 1e-12 && (found.viscous - 0.7).abs() < 1e-12 && found.most_error < 1e-11);
    assert_eq!(found.most_speed, 3.0);
    let none = NearestFriction::of(&robot, 1);
    assert_eq!((none.coulomb, none.viscous, none.most_error), (0.0, 0.0, 0.0));
}

#[test]
fn error_of_another_law_is_reported() {
    let model = tree().model().clone();
    let robot = RobotModel::new(model.clone(), vec![TorqueTerm::Offset(Offset { joint: 0 })], vec![1.5]).unwrap();
    let found = NearestFriction::of(&robot, 0);
    assert!(found.coulomb.abs() < 1e-12 && found.viscous.abs() < 1e-12);
    assert!((found.rms_error - 1.5).abs() < 1e-12 && (found.most_error - 1.5).abs() < 1e-12);

    // For friction that decreases with velocity the best damping would be negative, so it is zero.
    let shape = CoulombShape::Sign { dead_band: 0.0 };
    let falling = TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 1.0, exponent: 1.0, shape });
    let robot = RobotModel::new(model, vec![falling], vec![2.0]).unwrap();
    let found = NearestFriction::of(&robot, 0);
    // The mean of 2 exp(-v) over (0, 3], by 200 right ends: within a step's change of the integral.
    let mean = 2.0 * (1.0 - (-3.0_f64).exp()) / 3.0;
    assert_eq!(found.viscous, 0.0);
    assert!((found.coulomb - mean).abs() < 0.01, "{} {mean}", found.coulomb);
}

#[test]
fn a_urdf_reads_back_with_the_robots_bodies() {
    let robot = all_terms("ur10.urdf");
    let exported = export(&robot, Target::Urdf, &["-- from here".to_owned()]).unwrap();
    let back = read_urdf(&exported.text).unwrap().model;
    for (found, expected) in back.inertials().iter().zip(robot.model().inertials()) {
        for (found, expected) in found.0.iter().zip(expected.0) {
            // Written about the centre of mass and read back about the origin.
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
    let nearest = NearestFriction::of(&robot, 0);
    assert_eq!(back.joints()[0].damping, Some(nearest.viscous));
    assert_eq!(back.joints()[0].friction, Some(nearest.coulomb));
    for said in ["URDF has no drive inertia: Ia1 = 0.7 kg m²", "URDF has no gravity", "Ia_a = 0.2", "Joint elbow_joint"]
    {
        assert!(exported.notes.iter().any(|note| note.contains(said)), "{said}: {:#?}", exported.notes);
        assert!(exported.text.contains(said), "{said}");
    }
}

#[test]
fn mjcf_notes_unsupported_contents() {
    let exported = export(&tree(), Target::Mjcf, &[]).unwrap();
    assert!(exported.text.contains("type=\"slide\"") && exported.text.contains("armature=\"0.7\""));
    assert_eq!(exported.text.matches("<body").count(), exported.text.matches("</body>").count());
    assert!(exported.notes.iter().any(|note| note.contains("off by")), "{:#?}", exported.notes);
}
