//! SDF models compared with Drake, which reads them with Gazebo's library: joints, limits and torques.

use crate::golden::{close, numbers};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::{Joint, Model, load_robot};
use dynident_testing::repository;
use serde_json::Value;

/// Two programs in double precision on one file with nested poses: rounding only.
const RELATIVE: f64 = 1e-10;

/// Index of a joint `hand::bend` among Drake's names, where it is `bend`.
fn place(names: &[&str], joint: &Joint) -> usize {
    let own = joint.name.rsplit("::").next();
    names.iter().position(|name| Some(*name) == own).unwrap()
}

fn in_order(model: &Model, names: &[&str], values: &[f64]) -> Vec<f64> {
    model.joints().iter().map(|joint| values[place(names, joint)]).collect()
}

#[test]
fn every_model_has_the_joints_and_torques_of_drake() {
    let text = std::fs::read_to_string(repository("golden/sdf.json")).unwrap();
    let golden: Value = serde_json::from_str(&text).unwrap();
    let models = golden["models"].as_object().unwrap();
    assert_eq!(models.len(), 23);
    for (name, file) in models {
        let model = load_robot(repository(&format!("golden/sdf/{name}.sdf"))).unwrap().model;
        let names: Vec<&str> = file["joints"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
        assert_eq!(model.dof(), names.len(), "{name}");
        for joint in model.joints() {
            let k = place(&names, joint);
            assert_eq!(joint.is_rotary(), file["turns"][k].as_bool().unwrap(), "{name}: {}", joint.name);
            let limits = [joint.limits.lower, joint.limits.upper, joint.limits.velocity];
            let theirs = ["lower", "upper", "velocity"].map(|key| file[key][k].as_f64());
            assert_eq!(limits, theirs, "{name}: {}", joint.name);
            assert_eq!(joint.damping.unwrap_or(0.0), file["damping"][k].as_f64().unwrap(), "{name}: {}", joint.name);
        }
        let mut workspace = Workspace::new(&model);
        for state in file["states"].as_array().unwrap() {
            let [q, dq, ddq, tau] =
                ["q", "dq", "ddq", "tau"].map(|key| in_order(&model, &names, &numbers(&state[key])));
            close(RELATIVE, inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq), &tau, name);
        }
    }
}
