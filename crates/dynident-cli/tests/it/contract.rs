//! The contract for scripts: exit statuses, JSON, and files that are complete or absent.
use crate::common::{broken, command, repository, run_in};
use core::fmt::Write;
use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;

pub(crate) fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn has(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(value.get(key).is_some(), "no `{key}` in {value}");
    }
}

/// A realistic log, 1,500 rows at 100 Hz: torques of the fixture's arm from the command `evaluate`, friction, and a
/// noise of a few mNm.
pub(crate) fn honest_log(folder: &Path) {
    let mut states = "q1,q2,dq1,dq2,ddq1,ddq2\n".to_owned();
    let motion = |t: f64| {
        let mut moved = [[0.0; 3]; 2];
        for (joint, terms) in [[(0.7, 2.1), (0.3, 5.3)], [(0.9, 3.1), (0.25, 6.7)]].into_iter().enumerate() {
            for (a, w) in terms {
                let (sin, cos) = f64::sin_cos(w * t);
                moved[joint][0] += a * sin;
                moved[joint][1] += a * w * cos;
                moved[joint][2] -= a * w * w * sin;
            }
        }
        moved
    };
    let motions: Vec<[[f64; 3]; 2]> = (0..1500).map(|row| motion(0.01 * f64::from(row))).collect();
    for [a, b] in &motions {
        writeln!(states, "{},{},{},{},{},{}", a[0], b[0], a[1], b[1], a[2], b[2]).unwrap();
    }
    std::fs::write(folder.join("states.csv"), states).unwrap();
    let states = folder.join("states.csv").display().to_string();
    let ran = run_in(&broken(), &["evaluate", "arm.urdf", "--states", &states, "--quantity", "inverse-dynamics"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let mut log = "t,q1,q2,tau1,tau2\n".to_owned();
    for (row, (line, [a, b])) in ran.stdout.lines().skip(1).zip(&motions).enumerate() {
        let torques: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
        let noise = |k: usize| 0.004 * f64::sin(12.9898 * (2 * row + k) as f64) * f64::sin(78.233 * row as f64);
        let tau = |k: usize, dq: f64| torques[k] + 0.3 * dq + 0.2 * (dq / 0.05).tanh() + noise(k);
        writeln!(log, "{:.2},{:.9},{:.9},{:.6},{:.6}", 0.01 * row as f64, a[0], b[0], tau(0, a[1]), tau(1, b[1]))
            .unwrap();
    }
    std::fs::write(folder.join("honest.csv"), log).unwrap();
}

/// Identifies the fixture's arm from one part of a realistic log, validated on the other, into `out`; returns standard
/// output.
fn identify_held_out(out: &Path, further: &[&str]) -> crate::common::CommandOutcome {
    honest_log(out);
    let log = out.join("honest.csv").display().to_string();
    let study = std::fs::read_to_string(broken().join("good.toml")).unwrap();
    let study = study.replace("file = \"log.csv\"", &format!("file = {log:?}\nrows = [0, 1000]"));
    let path = out.join("study.toml");
    let held_out = format!("\n[[log]]\nfile = {log:?}\nrows = [1000, 1500]\nrole = \"validate\"\n");
    std::fs::write(&path, format!("{study}{held_out}")).unwrap();
    let (path, out) = (path.display().to_string(), out.display().to_string());
    run_in(&broken(), &[&["identify", &path, "--out", &out, "--data", "."], further].concat())
}

#[test]
fn help_tells_the_path_and_needs_no_arguments() {
    let ran = run_in(&broken(), &["--help"]);
    assert_eq!(ran.status, 0);
    for step in [
        "1. dynident inspect",
        "2. dynident new",
        "3. dynident check",
        "4. dynident identify",
        "5. dynident validate",
        "6. ",
    ] {
        assert!(ran.stdout.contains(step), "{}", ran.stdout);
    }
    assert!(run_in(&broken(), &["--version"]).stdout.starts_with("dynident "));
    for name in ["inspect", "log", "new", "evaluate", "design", "check", "identify", "validate", "export"] {
        assert_eq!(run_in(&broken(), &[name, "--help"]).status, 0);
    }
}

#[test]
fn bad_usage_has_status_2() {
    for arguments in [
        &[][..],
        &["identfy", "good.toml"],
        &["identify"],
        &["identify", "good.toml", "--out", "x", "--threads", "0"],
        &["identify", "good.toml", "--out", "x", "--max-validation-error", "nan"],
        &["evaluate", "arm.urdf", "--states", "log.csv", "--quantity", "energy"],
        &["inspect"],
        &["inspect", "gone.urdf"],
        &["inspect", "."],
        &["validate", "gone.json", "--study", "good.toml"],
        &["validate", "log.csv", "--study", "good.toml"],
        &["validate", "binary.csv", "--study", "good.toml"],
    ] {
        let ran = run_in(&broken(), arguments);
        assert_eq!(ran.status, 2, "{arguments:?}: {}", ran.stderr);
        assert!(!ran.stderr.is_empty() && ran.stdout.is_empty() && !ran.stderr.contains("panicked"), "{arguments:?}");
    }
}

#[test]
fn inspect_prints_the_contracts_keys() {
    let robot = repository("robots/ur10.urdf").display().to_string();
    let ran = run_in(&broken(), &["inspect", &robot, "--json"]);
    assert_eq!(ran.status, 0);
    let value = json(&ran.stdout);
    has(&value, &["schema", "dof", "joints", "bodies", "base_parameters", "audit"]);
    assert_eq!(value["schema"], "dynident/inspection/1");
    assert_eq!(value["dof"], 6);
    has(&value["joints"][0], &["name", "type"]);
    has(&value["bodies"][0], &["name", "mass_kg"]);
    assert_eq!(value["base_parameters"]["count"], 36);
    assert_eq!(value["base_parameters"]["expressions"].as_array().unwrap().len(), 36);
    has(&value["audit"][0], &["level", "where", "what"]);
}

#[test]
fn a_description_with_problems_has_status_1() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(broken().join("arm.urdf")).unwrap();
    std::fs::write(folder.path().join("arm.urdf"), text.replace("mass value=\"2\"", "mass value=\"-2\"")).unwrap();
    let ran = run_in(folder.path(), &["inspect", "arm.urdf"]);
    assert_eq!(ran.status, 1, "{}", ran.stdout);
    assert!(ran.stdout.contains("PROBLEM"));
}

#[test]
fn identify_and_validate_agree_and_print_the_contracts_keys() {
    let folder = tempfile::tempdir().unwrap();
    let ran = identify_held_out(folder.path(), &["--json", "--threads", "1"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let printed = json(&ran.stdout);
    let written = json(&std::fs::read_to_string(folder.path().join("result.json")).unwrap());
    assert_eq!(printed, written);
    let keys = [
        "schema",
        "base_parameters",
        "bodies",
        "joints",
        "training",
        "validation",
        "physical",
        "timings_s",
        "couplings",
        "logs",
        "method",
        "robot",
        "name",
    ];
    has(&written, &keys);
    assert_eq!(written["schema"], "dynident/result/1");
    has(&written["base_parameters"][0], &["expression", "value", "std", "relative_std_percent"]);
    has(&written["validation"][0], &["log", "samples", "relative_error_percent", "joints", "raw", "prior"]);
    has(&written["validation"][0]["joints"][0], &["name", "rmse_nm", "relative_error_percent"]);
    has(&written["physical"], &["consistent"]);

    let study = folder.path().join("study.toml").display().to_string();
    let result = folder.path().join("result.json").display().to_string();
    let arguments = ["validate", &result, "--study", &study, "--data", ".", "--json", "--threads", "2"];
    let again = run_in(&broken(), &arguments);
    assert_eq!(again.status, 0, "{}", again.stderr);
    let again = json(&again.stdout);
    assert_eq!(again["schema"], "dynident/validation/1");
    assert_eq!(again["validation"], written["validation"]);
}

#[test]
fn two_threads_write_the_same_files_as_one() {
    // One folder for both, because the result contains the log's path.
    let folder = tempfile::tempdir().unwrap();
    let outcome = |threads: &str| {
        let ran = identify_held_out(folder.path(), &["--quiet", "--threads", threads]);
        assert_eq!((ran.status, &ran.stdout[..], &ran.stderr[..]), (0, "", ""));
        let mut result = json(&std::fs::read_to_string(folder.path().join("result.json")).unwrap());
        result.as_object_mut().unwrap().remove("timings_s").unwrap();
        (result, std::fs::read_to_string(folder.path().join("identified.urdf")).unwrap())
    };
    assert_eq!(outcome("1"), outcome("2"));
}

#[test]
fn a_worse_validation_than_asked_has_status_1() {
    let folder = tempfile::tempdir().unwrap();
    for (limit, status) in [("0", 1), ("1000", 0)] {
        let ran = identify_held_out(folder.path(), &["--max-validation-error", limit]);
        assert_eq!(ran.status, status, "{}", ran.stderr);
        assert!(folder.path().join("result.json").exists());
        let report = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
        assert!(report.ends_with("</html>") && report.contains("data-plot"));
    }
    let out = folder.path().display().to_string();
    let ran = run_in(&broken(), &["identify", "good.toml", "--out", &out, "--max-validation-error", "1000"]);
    assert_eq!(ran.status, 1, "nothing was held out, so nothing was proved: {}", ran.stderr);
}

#[test]
fn summaries_fit_eighty_columns_and_say_the_important_first() {
    let folder = tempfile::tempdir().unwrap();
    let ran = identify_held_out(folder.path(), &[]);
    assert_eq!(ran.status, 0);
    let only_progress = ran.stderr.lines().all(|line| line.starts_with("progress: "));
    assert!(only_progress, "no progress bar where nobody watches: {}", ran.stderr);
    let inspected = run_in(&broken(), &["inspect", &repository("robots/panda.urdf").display().to_string()]).stdout;
    for line in ran.stdout.lines().chain(inspected.lines()) {
        // File names may be longer.
        assert!(line.starts_with("wrote ") || line.chars().count() <= 80, "{line}");
    }
    let at = |words: &str| ran.stdout.find(words).unwrap_or_else(|| panic!("no `{words}` in\n{}", ran.stdout));
    assert!(at("held-out torque error") < at("error of exported files"));
    assert!(at("error of exported files") < at("torque error  fit %"));
    assert!(
        at("all joints") < at("error bars:") && at("error bars:") < at("physics:") && at("physics:") < at("wrote ")
    );
}

#[test]
fn outputs_are_whole_or_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let old = "an earlier result";
    for name in ["result.json", "report.html", "identified.urdf"] {
        std::fs::write(folder.path().join(name), old).unwrap();
    }
    let out = folder.path().display().to_string();
    for study in ["log_nan.toml", "rows_beyond.toml", "unknown_key.toml"] {
        assert_eq!(run_in(&broken(), &["identify", study, "--out", &out]).status, 2);
    }
    for name in ["result.json", "report.html", "identified.urdf"] {
        assert_eq!(std::fs::read_to_string(folder.path().join(name)).unwrap(), old);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3, "temporary files were left");
    // A file at the path of the folder: refused before the work, and the file is kept.
    let file = folder.path().join("result.json").display().to_string();
    let ran = run_in(&broken(), &["identify", "good.toml", "--out", &file]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("cannot be written"), "{}", ran.stderr);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), old);
    assert_eq!(run_in(&broken(), &["identify", "good.toml", "--out", "/dev/null/x"]).status, 2);
}

#[test]
fn a_reader_that_leaves_early_is_no_error() {
    let robot = repository("robots/ur10.urdf").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    let header: Vec<String> = ["q", "dq", "ddq"].iter().flat_map(|g| (1..=6).map(move |j| format!("{g}{j}"))).collect();
    let row = vec!["0.1"; 18].join(",");
    // Far more than the buffer of a pipe.
    let states = format!("{}\n{}", header.join(","), format!("{row}\n").repeat(2000));
    std::fs::write(folder.path().join("states.csv"), states).unwrap();
    for arguments in [
        &["evaluate", &robot, "--states", "states.csv", "--quantity", "regressor"][..],
        &["evaluate", &robot, "--states", "states.csv", "--quantity", "regressor", "--json"],
    ] {
        let mut child =
            command(folder.path(), arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut first = [0; 64];
        child.stdout.take().unwrap().read_exact(&mut first).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
