//! Actuators of Isaac Lab: the module runs with classes that keep their arguments in place of Isaac Lab's.

use super::common::has;
use dynident_export::{Actuator, isaac_lab};
use serde_json::Value;
use std::process::Command;

const CLASSES: &str = "class Cfg:\n    def __init__(self, **fields):\n        self.fields = dict(fields, kind=type(self).__name__)\n\n\n\
    class ImplicitActuatorCfg(Cfg):\n    pass\n\n\nclass DelayedPDActuatorCfg(Cfg):\n    pass\n";
const PRINT: &str = "import json, drives\nshown = lambda made: {name: one.fields for name, one in made.items()}\n\
    print(json.dumps([shown(drives.implicit()), shown(drives.delayed()), shown(drives.delayed(0.001))]))\n";

fn actuators() -> Vec<Actuator> {
    let one = |joint: &str, stiffness: f64, delay_s: f64, velocity_limit| Actuator {
        joint: joint.to_owned(),
        stiffness,
        damping: 0.1 + 0.2,
        armature: 1.0 / 3.0,
        friction: 0.07 * stiffness,
        effort_limit: (stiffness < 12.0).then_some(2.94),
        velocity_limit,
        delay_s,
    };
    vec![
        one("pan", 10.1, 0.0103, Some(4.5)),
        one("lift.1 \"a\"\nimport os", 11.2, 0.0103, Some(5.0)),
        one("jaw", 14.0, 0.0181, None),
    ]
}

/// Results of the functions: implicit, delayed with the written step, delayed with a step of 1 ms.
#[allow(clippy::print_stdout, reason = "a test that is skipped says so")]
fn made() -> Option<Vec<Value>> {
    if !has("python3") {
        println!("skipped: there is no `python3`");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let package = folder.path().join("isaaclab");
    std::fs::create_dir(&package).unwrap();
    let text = isaac_lab("arm", &actuators(), 0.005, vec!["A note\nimport os".to_owned()]).text;
    for (path, text) in [
        (package.join("__init__.py"), ""),
        (package.join("actuators.py"), CLASSES),
        (folder.path().join("drives.py"), &text),
        (folder.path().join("show.py"), PRINT),
    ] {
        std::fs::write(path, text).unwrap();
    }
    let output = Command::new("python3").arg("show.py").current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// The group of a joint by its escaped name, and its value of a field.
fn of<'a>(made: &'a Value, field: &str, escaped: &str) -> (&'a Value, &'a Value) {
    let own =
        made.as_object().unwrap().values().find(|group| {
            group["joint_names_expr"].as_array().unwrap().iter().any(|name| name.as_str() == Some(escaped))
        });
    let group = own.unwrap();
    (group, &group[field][escaped])
}

#[test]
fn every_value_arrives_at_its_joint_to_the_last_bit() {
    let Some(made) = made() else { return };
    // Python's re.escape, by hand.
    let escaped = ["pan", "lift\\.1\\ \"a\"\\\nimport\\ os", "jaw"];
    for (kind, made) in ["ImplicitActuatorCfg", "DelayedPDActuatorCfg", "DelayedPDActuatorCfg"].iter().zip(&made) {
        for (actuator, name) in actuators().iter().zip(escaped) {
            for (field, value) in [
                ("stiffness", actuator.stiffness),
                ("damping", actuator.damping),
                ("armature", actuator.armature),
                ("friction", actuator.friction),
                ("dynamic_friction", actuator.friction),
            ] {
                let (group, found) = of(made, field, name);
                assert_eq!(found.as_f64(), Some(value), "{field} of {name}");
                assert_eq!(&group["kind"], kind);
            }
            let limit = if *kind == "ImplicitActuatorCfg" { "effort_limit_sim" } else { "effort_limit" };
            assert_eq!(of(made, limit, name).1.as_f64(), Some(actuator.effort_limit.unwrap_or(1e9)));
            match actuator.velocity_limit {
                Some(limit) => assert_eq!(of(made, "velocity_limit_sim", name).1.as_f64(), Some(limit)),
                None => assert!(of(made, "velocity_limit_sim", name).0["velocity_limit_sim"].is_null()),
            }
        }
    }
}

#[test]
fn delays_are_whole_steps_and_joints_of_one_delay_share_a_group() {
    let Some(made) = made() else { return };
    assert_eq!(made[0].as_object().unwrap().len(), 2, "with and without a velocity limit");
    for (made, [pan, jaw]) in made[1..].iter().zip([[2, 4], [10, 18]]) {
        for (name, steps) in [("pan", pan), ("jaw", jaw)] {
            let (group, _) = of(made, "stiffness", name);
            assert_eq!((&group["min_delay"], &group["max_delay"]), (&Value::from(steps), &Value::from(steps)));
        }
        assert_eq!(made.as_object().unwrap().len(), 2);
    }
}

#[test]
fn notes_and_names_are_no_code() {
    let text = isaac_lab("arm\nimport os", &actuators(), 0.005, vec!["A note\nimport os".to_owned()]).text;
    assert_eq!(text.lines().filter(|line| line.trim_start().starts_with("import")).count(), 1, "{text}");
    assert!(text.is_ascii() || text.contains("# A note"));
}
