//! `design --check` and `--check-log`: an existing motion, checked like a designed one.
use crate::common::{broken, repository, run_in};
use serde_json::Value;
use std::path::Path;

const STUDY: &str = r#"
[robot]
file = ROBOT
[drive]
coulomb = "none"
[design]
search = { starts = 2, rounds = 0, evaluations_per_start = 60, polish_evaluations = 150, search_samples = 81 }
[design.defaults]
floor = false
self_collision = false
[design.limits]
joints = [
    { joint = "shoulder_pan_joint", acceleration = ACCELERATION },
    { joint = "shoulder_lift_joint", acceleration = ACCELERATION },
    { joint = "elbow_joint", acceleration = ACCELERATION },
]
"#;

fn study(folder: &Path, name: &str, acceleration: f64) {
    let robot = format!("{:?}", repository("robots/ur10.urdf").canonicalize().unwrap().display().to_string());
    let text = STUDY.replace("ROBOT", &robot).replace("ACCELERATION", &format!("{acceleration:?}"));
    std::fs::write(folder.join(name), text).unwrap();
}

/// The designed motion as a table has the same results within the accuracy of its splines at 100 Hz, and with tighter
/// limits the verdict lists the broken limits.
#[test]
fn a_designed_motion_given_as_a_file_has_the_figures_of_its_design() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "study.toml", 10.0);
    let ran = run_in(folder.path(), &["design", "study.toml", "--out", "out", "--json"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    let designed: Value = serde_json::from_str(&ran.stdout).unwrap();
    let check = |study: &str| {
        let ran =
            run_in(folder.path(), &["design", study, "--out", "judged", "--check", "out/trajectory.csv", "--json"]);
        (ran.status, serde_json::from_str::<Value>(&ran.stdout).unwrap_or_default(), ran.stderr)
    };
    let (status, judged, stderr) = check("study.toml");
    assert_eq!(status, 0, "{stderr}");
    assert_eq!((judged["family"].as_str(), judged["feasible"].as_bool()), (Some("given"), Some(true)));
    for key in ["log_det", "condition_number"] {
        let [a, b] = [&designed, &judged].map(|file| file[key].as_f64().unwrap());
        assert!((a / b - 1.0).abs() < 1e-4, "{key}: {a} {b}");
    }
    study(folder.path(), "tight.toml", 0.5);
    let (status, judged, _) = check("tight.toml");
    assert_eq!(status, 1);
    assert_eq!(judged["feasible"], false);
    assert!(judged["diagnosis"].to_string().contains("acceleration"), "{}", judged["diagnosis"]);
}

/// The excitation of a log is reported; an unknown log is an error.
#[test]
fn a_log_of_the_study_is_judged() {
    let folder = tempfile::tempdir().unwrap();
    let good = broken().join("good.toml");
    let log = |name: &str| {
        let good = good.display().to_string();
        run_in(folder.path(), &["design", &good, "--out", "judged", "--check-log", name, "--json"])
    };
    let known = log("log.csv");
    let judged: Value = serde_json::from_str(&known.stdout).unwrap_or_else(|_| panic!("{}", known.stderr));
    assert!(judged["given"].as_str().unwrap().contains("log"), "{}", judged["given"]);
    let forecast = judged["forecast"].as_array().unwrap();
    assert!(
        !forecast.is_empty() && forecast.iter().any(|parameter| parameter["std"].as_f64().is_some_and(|std| std > 0.0))
    );
    let unknown = log("no such log");
    assert_eq!(unknown.status, 2);
    assert!(unknown.stderr.contains("no such log"), "{}", unknown.stderr);
}
