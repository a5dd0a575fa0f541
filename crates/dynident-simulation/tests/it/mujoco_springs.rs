//! Declared torques against MuJoCo: a joint spring and a cable that is stretched beyond its length.

use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::read_mjcf;
use dynident_model::terms::{Declared, DeclaredLaw, Expression, JointMotion, JointNames, TorqueTerm};
use dynident_simulation::Plant;
use serde_json::Value;
use std::path::Path;

/// Torques of some hundred Nm, from some hundred operations in each of two programs.
const TOLERANCE: f64 = 1e-10;

fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|k| value[k].as_f64().unwrap())
}

#[test]
fn springs_and_cables_agree_with_mujoco() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let golden: Value =
        serde_json::from_str(&std::fs::read_to_string(root.join("golden/springs.json")).unwrap()).unwrap();
    let model = read_mjcf(golden["mjcf"].as_str().unwrap()).unwrap().model;
    let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let declared = |name: &str, joint, text: &str| {
        let expression = Expression::parse(text, &JointNames { own: Some(joint), names: &names }).unwrap();
        let (name, law) = (name.to_owned(), DeclaredLaw::Expression(expression));
        TorqueTerm::Declared(Declared { name, joint, law, unit: "N/m".to_owned(), nominal: None, is_spring: false })
    };
    // The cable from (0.1, 0.3) to 0.25 m along the link has the length sqrt(square); its torque is its force times the
    // derivative of its length.
    let square = "(0.1625 - 0.05 * cos(q) + 0.15 * sin(q))";
    let cable = format!("max(sqrt{square} - 0.3, 0) * (0.05 * sin(q) + 0.15 * cos(q)) / (2 * sqrt{square})");
    let springs = Declared::springs(&model);
    assert_eq!((springs.len(), &*springs[0].name, springs[0].joint), (1, "k_elbow", 1));
    assert_eq!((springs[0].nominal, springs[0].is_spring), (Some(40.0), true));
    let terms = [TorqueTerm::Declared(springs[0].clone()), declared("cable", 0, &cable)];
    let stiffness = [40.0, 900.0];
    let mut plant = Plant::new(&model, &terms, &stiffness).unwrap();
    let mut workspace = Workspace::new(&model);
    let mut pulls = 0;
    for state in golden["states"].as_array().unwrap() {
        let [q, dq, ddq, expected] = ["q", "dq", "ddq", "tau"].map(|key| pair(&state[key]));
        let mut tau = inverse_dynamics(&model, &mut workspace, &q, &dq, &ddq).to_vec();
        let motion = JointMotion { samples: 1, q: &q, dq: &dq, ddq: &ddq };
        for (term, value) in terms.iter().zip(stiffness) {
            let (joint, mut column) = (term.own_joint().unwrap(), [f64::NAN]);
            term.column(joint, &motion, &mut column);
            tau[joint] += value * column[0];
        }
        for (found, expected) in tau.iter().zip(expected) {
            assert!((found - expected).abs() < TOLERANCE, "{q:?}: {found} {expected}");
        }
        // Under MuJoCo's torques the plant has MuJoCo's accelerations: torques divided by inertias of some 0.1 kg m².
        plant.set_state(0.0, &q, &dq);
        let mut accelerations = [f64::NAN; 2];
        plant.accelerations(&expected, &mut accelerations).unwrap();
        for (found, expected) in accelerations.iter().zip(ddq) {
            assert!((found - expected).abs() < 100.0 * TOLERANCE, "{q:?}: {found} {expected}");
        }
        pulls += usize::from(state["cable_m"].as_f64().unwrap() > 0.3);
    }
    assert!((10..40).contains(&pulls), "taut and slack: {pulls}");
}
