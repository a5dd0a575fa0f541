//! `iterate` and `simulate` as commands: files, exit status, resuming.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

fn dynident(arguments: &[&str], study: &Path, out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dynident"));
    command.args(&arguments[..1]).arg(study).arg("--out").arg(out).args(&arguments[1..]).output().unwrap()
}

fn json(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

/// The paper's arm with the command: within the limits (18), every parameter within 0.007 after at most three runs, and
/// the contract is met.
#[test]
fn the_papers_example_converges_and_resumes() {
    let out = tempfile::tempdir().unwrap();
    let study = example("iterate_paper_2r.toml");
    let output = dynident(&["iterate"], &study, out.path());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("converged"));
    let file = out.path().join("iterations.json");
    let first = json(&file);
    assert_eq!(first["schema"], "dynident/iterations/1");
    assert_eq!(first["converged"], true);
    let runs = first["runs"].as_array().unwrap();
    assert!((2..=3).contains(&runs.len()));
    for (number, run) in runs.iter().enumerate() {
        assert_eq!(run["run"], number + 1);
        assert_eq!(run["max_tracking_error_rad"].as_array().unwrap().len(), 2);
        assert_eq!(run["parameters"].as_array().unwrap().len(), 6);
    }
    for parameter in runs[runs.len() - 1]["parameters"].as_array().unwrap() {
        assert!(!parameter["expression"].as_str().unwrap().is_empty());
        assert!(parameter["error"].as_f64().unwrap().abs() < 1e-6, "{parameter}");
    }
    assert!(std::fs::read_to_string(out.path().join("report.html")).unwrap().contains("converged"));
    // Without its last run and its summary it writes the same files again.
    let whole = std::fs::read(&file).unwrap();
    std::fs::remove_file(&file).unwrap();
    std::fs::remove_dir_all(out.path().join(format!("runs/run_{}", runs.len()))).unwrap();
    assert_eq!(dynident(&["iterate"], &study, out.path()).status.code(), Some(0));
    assert_eq!(std::fs::read(&file).unwrap(), whole);
    let other = dynident(&["iterate", "--seed", "9"], &study, out.path());
    assert_eq!(other.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&other.stderr).contains("other settings"));
}

/// A study that cannot converge in one run: exit status 1, and the file contains the status.
#[test]
fn runs_used_up_are_exit_status_one() {
    let out = tempfile::tempdir().unwrap();
    let robots = example("robots/paper_2r.toml");
    let text = std::fs::read_to_string(example("iterate_paper_2r.toml")).unwrap();
    let text = text.replace("max_runs = 6", "max_runs = 1").replace("robots/paper_2r.toml", robots.to_str().unwrap());
    let study = out.path().join("study.toml");
    std::fs::write(&study, text).unwrap();
    let output = dynident(&["iterate", "--json"], &study, &out.path().join("result"));
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let object: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&object["converged"], &object["status"]), (&Value::Bool(false), &Value::from("runs-used-up")));
}

#[test]
fn a_simulation_writes_log_and_truth() {
    let out = tempfile::tempdir().unwrap();
    let output = dynident(&["simulate", "--json"], &example("iterate_paper_2r.toml"), out.path());
    let truth = json(&out.path().join("truth.json"));
    assert_eq!(truth["schema"], "dynident/simulation/1");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let samples = truth["samples"].as_u64().unwrap() as usize;
    let log = std::fs::read_to_string(out.path().join("log.csv")).unwrap();
    assert!(log.starts_with("t_s,q1,q2,tau1,tau2\n"));
    assert_eq!(log.lines().count(), samples + 1);
    let values: Vec<f64> =
        truth["base_parameters"].as_array().unwrap().iter().map(|one| one["value"].as_f64().unwrap()).collect();
    // The paper's [2, 2, 0, 1, 1, 0] in the order of the columns.
    assert_eq!(values, [2.0, 0.0, 2.0, 1.0, 0.0, 1.0]);
}
