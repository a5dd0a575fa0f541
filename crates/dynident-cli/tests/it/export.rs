//! `dynident export`: files, errors, JSON; `dynident-export` tests the content.

use super::common::{CommandOutcome, broken, run_in};
use serde_json::{Value, json};
use std::path::Path;

const FORMS: [(&str, &str); 15] = [
    ("c", "arm_inverse_dynamics(const double q[2]"),
    ("cpp", "inline Vector inverse_dynamics(const Vector& q"),
    ("rust", "pub fn inverse_dynamics<M: Math>(q: &[f64; 2]"),
    ("python", "def inverse_dynamics(q, dq, ddq):"),
    ("matlab", "case 'inverse_dynamics'"),
    ("casadi", "return ca.Function(\"inverse_dynamics\", [q, dq, ddq]"),
    ("jax", "import jax.numpy as jnp"),
    ("pinocchio", "tree = pin.rnea(MODEL, DATA"),
    ("mjcf", "<mujoco model=\"arm\">"),
    ("urdf", "<robot name=\"arm\">"),
    ("sdf", "<model name=\"arm\">"),
    ("ros2-yaml", "  ros__parameters:\n    robot: \"arm\""),
    ("json", "\"schema\": \"dynident/model/1\""),
    ("simulator", "\"schema\": \"dynident/simulator/1\""),
    ("simulator-table", "| joint | armature | damping | frictionloss |"),
];

fn identified() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["arm.urdf", "log.csv", "good.toml"] {
        std::fs::copy(broken().join(name), folder.path().join(name)).unwrap();
    }
    // The fixture is short and may have a PROBLEM; its result is still written.
    run_in(folder.path(), &["identify", "good.toml", "--out", "r"]);
    folder
}

fn export(folder: &Path, more: &[&str]) -> CommandOutcome {
    run_in(folder, &[&["export", "r/result.json", "--study", "good.toml", "--to"], more].concat())
}

#[test]
fn every_form_is_written() {
    let folder = identified();
    let at = folder.path();
    for (form, holds) in FORMS {
        let printed = export(at, &[form]);
        assert_eq!(printed.status, 0, "{form}: {}", printed.stderr);
        assert!(printed.stdout.contains(holds), "{form}: {}", printed.stdout);
        let told = export(at, &[form, "--out", "robot.txt", "--json"]);
        let told: Value = serde_json::from_str(&told.stdout).unwrap();
        assert_eq!((&told["schema"], &told["target"]), (&json!("dynident/export/1"), &json!(form)));
        assert_eq!((&told["file"], told.get("text")), (&json!("robot.txt"), None));
        let written = std::fs::read_to_string(at.join("robot.txt")).unwrap();
        assert_eq!(written.trim_end(), printed.stdout.trim_end(), "{form}");
        for note in told["notes"].as_array().unwrap() {
            assert!(printed.stderr.contains(note.as_str().unwrap()), "{form}: {note}");
        }
    }
}

#[test]
fn options_of_code() {
    let folder = identified();
    let at = folder.path();
    let text = |more: &[&str]| {
        let printed = export(at, more);
        assert_eq!(printed.status, 0, "{}", printed.stderr);
        printed.stdout
    };
    assert!(text(&["c", "--float32"]).contains("const float q[2]"));
    let with_regressor = text(&["rust", "--regressor"]);
    assert!(with_regressor.contains("pub fn regressor<M: Math>") && with_regressor.contains("parameter 0: "));
    assert!(text(&["python", "--step-width", "0.5"]).contains("have a width of at least 0.5 rad/s"));
    let refused = |more: &[&str], says: &str| {
        let outcome = export(at, more);
        assert_eq!(outcome.status, 2, "{}", outcome.stderr);
        assert!(outcome.stderr.contains(says), "{}", outcome.stderr);
    };
    refused(&["urdf", "--float32"], "the form urdf has no option float32");
    refused(&["c", "--step-width", "0"], "not a positive finite number");
    refused(&["simulator", "--regressor"], "options of code");
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let folder = identified();
    let at = folder.path();
    let refused = |outcome: CommandOutcome, says: &str| {
        assert_eq!(outcome.status, 2, "{}", outcome.stderr);
        assert!(outcome.stderr.contains(says), "{}", outcome.stderr);
        assert_eq!(outcome.stdout, "");
    };
    refused(run_in(at, &["export", "r/result.json", "--to", "simulator"]), "--study STUDY.toml is missing");
    refused(export(at, &["c", "--out", "arm.urdf"]), "arm.urdf");
    refused(export(at, &["c", "--out", "r/result.json"]), "result.json");
    refused(export(at, &["payload-ur"]), "no payload was estimated: add [[payload]] to the study");
    refused(run_in(at, &["export", "good.toml", "--study", "good.toml", "--to", "c"]), "not a result");

    let result = std::fs::read_to_string(at.join("r/result.json")).unwrap();
    let mut other: Value = serde_json::from_str(&result).unwrap();
    other["bodies"][1]["name"] = json!("hand");
    std::fs::write(at.join("r/result.json"), other.to_string()).unwrap();
    refused(export(at, &["c"]), "edited or damaged");
    refused(export(at, &["c", "--accept-edited"]), "use the study that the result was made with");
    refused(run_in(at, &["export", "r", "--to", "c", "--accept-edited"]), "`bodies` differ from `model`");
    other.as_object_mut().unwrap().remove("model");
    std::fs::write(at.join("r/result.json"), other.to_string()).unwrap();
    refused(run_in(at, &["export", "r", "--to", "c", "--accept-edited"]), "--study STUDY.toml");
}

/// A result holds its robot: no study is needed, and its folder is enough.
#[test]
fn a_result_is_exported_without_its_study() {
    let folder = identified();
    let at = folder.path();
    for form in ["c", "python", "mjcf", "urdf", "sdf", "ros2-yaml", "json"] {
        let (with, without) = (export(at, &[form]), run_in(at, &["export", "r", "--to", form]));
        assert_eq!(without.status, 0, "{form}: {}", without.stderr);
        assert_eq!(without.stdout, with.stdout, "{form}");
        assert_eq!(without.stderr, with.stderr, "{form}");
    }
}

#[test]
fn a_payload_becomes_a_command() {
    let folder = identified();
    let at = folder.path();
    let path = at.join("r/result.json");
    let mut result: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    result["provenance"].as_object_mut().unwrap().remove("content_sha256").unwrap();
    let possible = json!({
        "mass_kg": 2.0, "com_m": [0.0, 0.0, 0.125], "inertia_at_com_kgm2": [0.25, 0.0, 0.0, 0.25, 0.0, 0.25],
        "moved_sigma": 0.0, "on_the_boundary": false
    });
    let payload = |name: &str, possible: &Value| {
        json!({
            "name": name, "link": "tool0", "logs": [], "parameters": [], "mass_kg": null, "com_m": [null, null, null],
            "inertia_at_com_kgm2": [null, null, null, null, null, null], "not_identified": ["Ixx"],
            "possible": possible, "failure": "none fits", "base_parameters_added": []
        })
    };
    result["payloads"] = json!([payload("box", &possible), payload("ghost", &Value::Null)]);
    std::fs::write(&path, result.to_string()).unwrap();
    let export = |more: &[&str]| run_in(at, &[&["export", "r/result.json", "--to"], more].concat());
    let found = export(&["payload-ur", "--payload", "box"]);
    assert_eq!(found.stdout.trim(), "set_target_payload(2.0, [0.0, 0.0, 0.125], [0.25, 0.25, 0.25, 0.0, 0.0, 0.0])");
    assert!(found.stderr.contains("link tool0") && found.stderr.contains("Not measured: Ixx"), "{}", found.stderr);
    let several = export(&["payload-kuka"]);
    assert!(several.status == 2 && several.stderr.contains("`box`, `ghost`"), "{}", several.stderr);
    let none = export(&["payload-abb", "--payload", "ghost"]);
    assert!(none.status == 2 && none.stderr.contains("no body that can be real: none fits"), "{}", none.stderr);
}
