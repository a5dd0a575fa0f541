//! What other people's scripts rest on: exit statuses, JSON, files that are whole or not there.
use crate::common::{broken, command, repository, run_in};
use serde_json::Value;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn has(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(value.get(key).is_some(), "no `{key}` in {value}");
    }
}

/// Identifies the good study with a held-out part into `out`; returns standard output.
fn identify_held_out(out: &Path, further: &[&str]) -> crate::common::CommandOutcome {
    let study = std::fs::read_to_string(broken().join("good.toml")).unwrap();
    let study = study.replace("file = \"log.csv\"", "file = \"log.csv\"\nrows = [0, 250]");
    let path = out.join("study.toml");
    let held_out = "\n[[log]]\nfile = \"log.csv\"\nrows = [250, 400]\nrole = \"validate\"\n";
    std::fs::write(&path, format!("{study}{held_out}")).unwrap();
    let (path, out) = (path.display().to_string(), out.display().to_string());
    run_in(&broken(), &[&["identify", &path, "--out", &out, "--data", "."], further].concat())
}

#[test]
fn help_tells_the_path_and_needs_no_arguments() {
    let ran = run_in(&broken(), &["--help"]);
    assert_eq!(ran.status, 0);
    for step in ["1. dynident inspect", "2. write study.toml", "3. dynident identify", "4. dynident validate", "5. "] {
        assert!(ran.stdout.contains(step), "{}", ran.stdout);
    }
    assert!(run_in(&broken(), &["--version"]).stdout.starts_with("dynident "));
    for name in ["inspect", "evaluate", "design", "identify", "validate"] {
        assert_eq!(run_in(&broken(), &[name, "--help"]).status, 0);
    }
}

#[test]
fn bad_usage_has_status_2() {
    for arguments in [
        &[][..],
        &["identfy", "good.toml"],
        &["identify", "good.toml"],
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
    let outcome = |threads: &str| {
        let folder = tempfile::tempdir().unwrap();
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
    assert!(ran.stderr.is_empty(), "no progress bar where nobody watches: {}", ran.stderr);
    let inspected = run_in(&broken(), &["inspect", &repository("robots/panda.urdf").display().to_string()]).stdout;
    for line in ran.stdout.lines().chain(inspected.lines()) {
        // Names of files may be as long as they are.
        assert!(line.starts_with("wrote ") || line.chars().count() <= 80, "{line}");
    }
    let at = |words: &str| ran.stdout.find(words).unwrap_or_else(|| panic!("no `{words}` in\n{}", ran.stdout));
    assert!(at("held-out torque error") < at("torque error  fit %"));
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
    // A file where the folder should be: refused before the work, and the file stays.
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
    // Far more than a pipe holds.
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
