//! MJCF models compared with MuJoCo: joints, ranges, drives, masses and torques.

use crate::golden::{close, numbers};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::{InertialParameters, load_robot};
use dynident_testing::repository;
use serde_json::Value;

/// Two programs in double precision on one file, MuJoCo with quaternions and principal axes: rounding only.
const RELATIVE: f64 = 1e-10;

#[test]
fn every_model_has_the_joints_and_torques_of_mujoco() {
    let text = std::fs::read_to_string(repository("golden/mjcf.json")).unwrap();
    let golden: Value = serde_json::from_str(&text).unwrap();
    let models = golden["models"].as_object().unwrap();
    assert!(models.len() >= 24, "{} models", models.len());
    for (name, file) in models {
        let robot = load_robot(repository(&format!("golden/mjcf/{name}.xml"))).unwrap();
        let model = robot.model;
        let joints = model.joints();
        assert_eq!(joints.len(), file["joints"].as_array().unwrap().len(), "{name}");
        for (k, joint) in joints.iter().enumerate() {
            // Joints may have no name in MuJoCo.
            if let Some(theirs) = file["joints"][k].as_str() {
                assert_eq!(joint.name, theirs, "{name}");
            }
            let what = format!("{name}: {}", joint.name);
            assert_eq!(joint.is_rotary(), file["turns"][k].as_bool().unwrap(), "{what}");
            let stops = joint.limits.lower.zip(joint.limits.upper);
            assert_eq!(stops.is_some(), file["limited"][k].as_bool().unwrap(), "{what}");
            if let Some((lower, upper)) = stops {
                close(RELATIVE, &[lower, upper], &numbers(&file["range"][k]), &what);
            }
            let stated = [joint.drive_inertia, joint.damping, joint.friction].map(|value| value.unwrap_or(0.0));
            let theirs = ["armature", "damping", "frictionloss"].map(|key| file[key][k].as_f64().unwrap());
            assert_eq!(stated, theirs, "{what}");
        }
        assert_eq!(model.gravity().0[..], numbers(&file["gravity"]), "{name}");
        let mass: f64 = model.inertials().iter().map(InertialParameters::mass_kg).sum();
        close(RELATIVE, &[mass], &[file["moving_mass"].as_f64().unwrap()], &format!("{name}: mass"));
        let mut workspace = Workspace::new(&model);
        for state in file["states"].as_array().unwrap() {
            let [q, dq, ddq, tau] = ["q", "dq", "ddq", "tau"].map(|key| numbers(&state[key]));
            close(RELATIVE, inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq), &tau, name);
        }
    }
}
