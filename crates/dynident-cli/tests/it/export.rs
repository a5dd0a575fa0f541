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

/// The same with the last third of the log held out.
fn identified_with_test() -> tempfile::TempDir {
    let folder = identified();
    let path = folder.path().join("good.toml");
    let study = std::fs::read_to_string(&path).unwrap();
    let log = "[[log]]\nfile = \"log.csv\"\n";
    let parts = format!("{log}fraction = [0.0, 0.65]\n{log}fraction = [0.67, 1.0]\nrole = \"validate\"\n");
    std::fs::write(&path, study.replace(log, &parts)).unwrap();
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

fn sha256(path: &Path) -> String {
    use sha2::{Digest, Sha256};
    let hash = Sha256::digest(std::fs::read(path).unwrap());
    hash.iter().fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

/// Each model of `identify` and each exported file has its own held-out error next to it.
#[test]
fn the_error_of_a_file_is_next_to_it() {
    let folder = identified_with_test();
    let at = folder.path();
    let read =
        |name: &str| -> Value { serde_json::from_str(&std::fs::read_to_string(at.join(name)).unwrap()).unwrap() };
    let result = read("r/result.json");
    for (form, file) in [("urdf", "r/identified.urdf"), ("mjcf", "arm.xml"), ("c", "arm.h"), ("json", "arm.json")] {
        if form != "urdf" {
            assert_eq!(export(at, &[form, "--out", file]).status, 0);
        }
        let found = read(&format!("{file}.validation.json"));
        assert_eq!((&found["schema"], &found["form"]), (&json!("dynident/export-validation/1"), &json!(form)));
        assert_eq!(found["sha256"], sha256(&at.join(file)));
        assert!(file.ends_with(found["file"].as_str().unwrap()));
        assert_eq!(found["provenance"]["identity"], result["provenance"]["identity"]);
        let class = result["forms"]
            .as_array()
            .unwrap()
            .iter()
            .find(|one| one["forms"].as_array().unwrap().contains(&json!(form)));
        let logs = found["held_out"].as_array().unwrap();
        if let Some(class) = class {
            assert_eq!((&found["held_out"], &found["refitted"]), (&class["held_out"], &class["refitted"]));
        } else {
            let of_model = &result["validation"][0]["physical"]["relative_error_percent"];
            assert_eq!((&logs[0]["relative_error_percent"], &found["left_out"]), (of_model, &json!([])));
        }
        assert_eq!((logs.len(), logs[0]["joints"].as_array().unwrap().len()), (1, 2), "{found}");
        // Terms of the model are in the file or listed.
        let listed = found["left_out"].as_array().unwrap();
        let kept = |symbol: &Value| {
            class.is_none_or(|class| class["terms"].as_array().unwrap().iter().any(|term| term["symbol"] == *symbol))
        };
        for term in result["model"]["terms"].as_array().unwrap() {
            let is_listed = listed.iter().any(|one| one["symbol"] == term["symbol"] && one["value"] == term["value"]);
            assert!(is_listed || kept(&term["symbol"]), "{form}: {term}");
        }
        // The comment of each file lists them with their values.
        let text = std::fs::read_to_string(at.join(file)).unwrap();
        for term in listed {
            assert!(text.contains(&format!("{} = ", term["symbol"].as_str().unwrap())), "{form}: {term}");
        }
        if class.is_some() {
            assert!(text.contains("Held-out torque error of this file: "), "{form}: {text}");
            // The URDF of `identify` states the sources at each link.
            let sources = ["Values of bodies measured from torque: ", "in the link's frame, identified: "];
            assert!(sources.iter().any(|words| text.contains(words)), "{form}: {text}");
        }
    }
    // Files with error bars have none.
    assert_eq!(export(at, &["simulator", "--out", "drives.json"]).status, 0);
    assert!(!at.join("drives.json.validation.json").exists());
}

/// Another program can repeat the test: `--samples` writes the samples and the filter, and the error of the identified
/// URDF computed from them is the printed one.
#[test]
fn samples_of_a_test_are_written() {
    let folder = identified_with_test();
    let at = folder.path();
    let ran = run_in(at, &["validate", "r/result.json", "--study", "good.toml", "--samples", "samples", "--json"]);
    assert!(ran.status < 2, "{}", ran.stderr);
    let samples: Value =
        serde_json::from_str(&std::fs::read_to_string(at.join("samples/samples.json")).unwrap()).unwrap();
    assert_eq!(samples["schema"], "dynident/test-samples/1");
    let result: Value = serde_json::from_str(&std::fs::read_to_string(at.join("r/result.json")).unwrap()).unwrap();
    let logs = samples["logs"].as_array().unwrap();
    let held_out = logs.iter().find(|log| log["role"] == "validate").unwrap();
    assert_eq!(held_out["log"], result["forms"][0]["held_out"][0]["log"]);
    let table = std::fs::read_to_string(at.join("samples").join(held_out["file"].as_str().unwrap())).unwrap();
    let mut lines = table.lines();
    assert_eq!(
        lines.next(),
        Some(
            "segment,q_shoulder,q_elbow,dq_shoulder,dq_elbow,ddq_shoulder,ddq_elbow,tau_shoulder,tau_elbow,used_shoulder,used_elbow"
        )
    );
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    let robot = dynident::load_robot(&at.join("r/identified.urdf"), &dynident::LoadSettings::default()).unwrap();
    let model = &robot.model;
    let taps: Vec<f64> = held_out["taps"].as_array().unwrap().iter().map(|tap| tap.as_f64().unwrap()).collect();
    let taps = if taps.is_empty() { vec![1.0] } else { taps };
    let factor = held_out["filter"]["factor"].as_u64().unwrap_or(1) as usize;
    let mut workspace = dynident::dynamics::Workspace::new(model);
    let (mut error, mut torque) = (0.0, 0.0);
    for joint in 0..2 {
        let (damping, friction) = (model.joints()[joint].damping.unwrap(), model.joints()[joint].friction.unwrap());
        let columns: Vec<[f64; 3]> = rows
            .iter()
            .map(|row| {
                let rigid =
                    dynident::dynamics::inverse_dynamics(model, &mut workspace, &row[1..3], &row[3..5], &row[5..7]);
                let dq = row[3 + joint];
                let sign = if dq == 0.0 { 0.0 } else { dq.signum() };
                let used = row[9 + joint];
                [used * row[7 + joint], used * (rigid[joint] + damping * dq + friction * sign), used]
            })
            .collect();
        for from in (0..columns.len().saturating_sub(taps.len() - 1)).step_by(factor) {
            let sum = |k: usize| taps.iter().zip(&columns[from..]).map(|(tap, column)| tap * column[k]).sum::<f64>();
            let [measured, predicted, coverage] = [sum(0), sum(1), sum(2)];
            if coverage >= 0.5 {
                error += ((measured - predicted) / coverage).powi(2);
                torque += (measured / coverage).powi(2);
            }
        }
    }
    let form =
        &result["forms"].as_array().unwrap().iter().find(|form| form["class"] == "damping-and-friction").unwrap();
    let printed = form["held_out"][0]["relative_error_percent"].as_f64().unwrap();
    let own = 100.0 * (error / torque).sqrt();
    // Rounding of sums in another order.
    assert!((own / printed - 1.0).abs() < 1e-9, "{own} % and {printed} % printed");
}
