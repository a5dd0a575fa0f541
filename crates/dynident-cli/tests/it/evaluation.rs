//! `evaluate` compared with the library to the last digit, and with Pinocchio.
use crate::common::{repository, run_in};
use dynident::dynamics::{
    Workspace, coriolis_matrix, forward_dynamics, gravity_torque, gravity_torque_derivative, inverse_dynamics,
    mass_matrix, torque_regressor,
};
use dynident::model::load_robot;
use serde_json::Value;
use std::path::Path;

struct Golden {
    robot: String,
    states: Vec<Value>,
    /// Index of each joint in Pinocchio, which sorts joints by name.
    place: Vec<usize>,
    /// Folder of the robot description.
    _folder: tempfile::TempDir,
}

fn golden(name: &str) -> Golden {
    let text = std::fs::read_to_string(repository(&format!("golden/pinocchio/{name}.json"))).unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    // Without mimic joints, so that every joint of the file is independent.
    let text = std::fs::read_to_string(repository(&format!("robots/{name}.urdf"))).unwrap();
    let free: Vec<&str> = text.lines().filter(|line| !line.contains("<mimic")).collect();
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("robot.urdf").display().to_string();
    std::fs::write(&robot, free.join("\n")).unwrap();
    let model = load_robot(&robot).unwrap().model;
    let joints = value["joints"].as_array().unwrap();
    let place = joints.iter().map(|joint| model.joint_index(joint.as_str().unwrap()).unwrap()).collect();
    Golden { robot, states: value["states"].as_array().unwrap().clone(), place, _folder: folder }
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap()],
    }
}

fn evaluate(folder: &Path, golden: &Golden, groups: [(&str, &str); 3], quantity: &str) -> Vec<Vec<f64>> {
    let header: Vec<String> =
        groups.iter().flat_map(|(group, _)| golden.place.iter().map(move |j| format!("{group}{}", j + 1))).collect();
    let mut text = header.join(",") + "\n";
    for state in &golden.states {
        let row: Vec<String> =
            groups.iter().flat_map(|(_, key)| numbers(&state[*key])).map(|x| x.to_string()).collect();
        text += &(row.join(",") + "\n");
    }
    std::fs::write(folder.join("states.csv"), text).unwrap();
    let arguments = ["evaluate", &golden.robot, "--states", "states.csv", "--quantity", quantity];
    let ran = run_in(folder, &arguments);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let rows: Vec<Vec<f64>> =
        ran.stdout.lines().skip(1).map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    // The same numbers as one JSON object, and in a file.
    let object: Value = serde_json::from_str(&run_in(folder, &[&arguments[..], &["--json"]].concat()).stdout).unwrap();
    assert_eq!(object["schema"], "dynident/evaluation/1");
    let values: Vec<Vec<f64>> = object["values"].as_array().unwrap().iter().map(numbers).collect();
    assert_eq!(values, rows);
    assert_eq!(object["columns"].as_array().unwrap().len(), rows[0].len());
    run_in(folder, &[&arguments[..], &["--out", "out.csv"]].concat());
    assert_eq!(std::fs::read_to_string(folder.join("out.csv")).unwrap(), ran.stdout);
    rows
}

const MOTION: [(&str, &str); 3] = [("q", "q"), ("dq", "dq"), ("ddq", "ddq")];

#[test]
fn every_quantity_is_the_librarys_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    let golden = golden("ur10");
    let model = load_robot(&golden.robot).unwrap().model;
    let mut w = Workspace::new(&model);
    let matrices = ["mass-matrix", "coriolis-matrix", "gravity-derivative"];
    let all = ["inverse-dynamics", "forward-dynamics", "gravity", "regressor"].into_iter().chain(matrices);
    for quantity in all {
        let third = if quantity == "forward-dynamics" { ("tau", "tau") } else { ("ddq", "ddq") };
        let rows = evaluate(folder.path(), &golden, [("q", "q"), ("dq", "dq"), third], quantity);
        assert_eq!(rows.len(), golden.states.len());
        for (row, state) in rows.iter().zip(&golden.states) {
            let [q, dq, third] = ["q", "dq", third.1].map(|key| numbers(&state[key]));
            let expected = match quantity {
                "inverse-dynamics" => inverse_dynamics(&model, &mut w, &q, &dq, &third).to_vec(),
                "forward-dynamics" => forward_dynamics(&model, &mut w, &q, &dq, &third).to_vec(),
                "mass-matrix" => mass_matrix(&model, &mut w, &q).to_vec(),
                "coriolis-matrix" => coriolis_matrix(&model, &mut w, &q, &dq).to_vec(),
                "gravity" => gravity_torque(&model, &mut w, &q).to_vec(),
                "gravity-derivative" => gravity_torque_derivative(&model, &mut w, &q).to_vec(),
                _ => torque_regressor(&model, &mut w, &q, &dq, &third).to_vec(),
            };
            assert_eq!(*row, expected, "{quantity}");
        }
    }
}

#[test]
fn torques_are_pinocchios() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["ur10", "panda", "planar2r", "talos_reduced"] {
        let golden = golden(name);
        let rows = evaluate(folder.path(), &golden, MOTION, "inverse-dynamics");
        for (row, state) in rows.iter().zip(&golden.states) {
            let tau = numbers(&state["tau"]);
            let largest = tau.iter().fold(0.0_f64, |max, t| max.max(t.abs()));
            for (found, expected) in golden.place.iter().map(|&j| row[j]).zip(&tau) {
                // The required accuracy.
                assert!((found - expected).abs() <= 1e-10 * largest, "{name}: {found} {expected}");
            }
        }
    }
}
