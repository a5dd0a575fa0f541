//! The command `design`: feasible motions, the keys of the contract, identical results for any number of threads,
//! errors and diagnoses.
use crate::common::{CommandOutcome, repository, run_in};
use serde_json::Value;
use std::path::Path;

/// A search of about a second without full optimisation.
const SMALL: &str =
    "search = { starts = 3, rounds = 0, evaluations_per_start = 60, polish_evaluations = 150, search_samples = 81 }";

const NO_DEFAULTS: &str =
    "[design.defaults]\nfloor = false\nself_collision = false\nacceleration = false\nstop_margin_percent = 0\n";

/// A study on the UR10 with the given keys of `[design]`, in `folder`.
fn study(folder: &Path, design: &str, acceleration: f64) {
    let robot = repository("robots/ur10.urdf").canonicalize().unwrap();
    let joints = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
        .map(|joint| format!("{{ joint = \"{joint}_joint\", acceleration = {acceleration:?} }}"));
    let text = format!(
        "[robot]\nfile = {:?}\n[drive]\ncoulomb = \"sign\"\n[design]\n{design}\n{NO_DEFAULTS}[design.limits]\njoints = [{}]\n",
        robot.display().to_string(),
        joints.join(", ")
    );
    std::fs::write(folder.join("study.toml"), text).unwrap();
}

fn run(folder: &Path, further: &[&str]) -> CommandOutcome {
    run_in(folder, &[&["design", "study.toml", "--out", "out"], further].concat())
}

fn written(folder: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join("out/design.json")).unwrap()).unwrap()
}

#[test]
fn a_design_is_feasible_complete_and_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), SMALL, 10.0);
    let all = ["--to", "ros2", "--to", "urscript", "--to", "waypoints"];
    let ran = run(folder.path(), &[&["--json", "--threads", "1", "--seed", "4"], &all[..]].concat());
    assert_eq!(ran.status, 0, "{}\n{}", ran.stdout, ran.stderr);
    let mut first = written(folder.path());
    assert_eq!(serde_json::from_str::<Value>(&ran.stdout).unwrap(), first);
    for key in [
        "family",
        "criterion",
        "condition_number",
        "condition_number_scaled",
        "log_det",
        "duration_s",
        "feasible",
        "limits",
        "forecast",
        "worst_directions",
        "evaluations",
        "cpu_s",
        "seconds",
        "seed",
        "diagnosis",
        "parameters",
    ] {
        assert!(first.get(key).is_some(), "no `{key}`");
    }
    assert_eq!(first["schema"], "dynident/design/1");
    assert_eq!((&first["feasible"], &first["seed"]), (&Value::Bool(true), &Value::from(4)));
    // Position, velocity, acceleration and torque of six joints.
    let limits = first["limits"].as_array().unwrap();
    assert_eq!(limits.len(), 24);
    assert!(limits.iter().all(|limit| limit["worst_ratio"].as_f64().unwrap() <= 1.0 + 1e-6), "{limits:?}");
    // 36 inertial base parameters, viscous friction, Coulomb friction and offset of six joints.
    let forecast = first["forecast"].as_array().unwrap();
    assert_eq!(forecast.len(), 36 + 18);
    assert!(forecast.iter().all(|p| p["std"].as_f64().unwrap() > 0.0 && p["unit"].is_string()), "{forecast:?}");
    assert!(first["notes"][0].as_str().unwrap().contains("smooth"), "{}", first["notes"]);

    // At rest at both ends, and on the requested grid.
    let table = std::fs::read_to_string(folder.path().join("out/trajectory.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        table.lines().skip(1).map(|row| row.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!((rows.len(), rows[0].len(), rows[1000][0]), (1001, 19, 10.0));
    // The series' coefficients are solved for exact rest; rounding of sums of ten terms below 100.
    assert!([&rows[0], &rows[1000]].iter().all(|row| row[7..].iter().all(|rate| rate.abs() < 1e-11)));
    for (file, holds) in [
        ("preview.svg", "</svg>"),
        ("report.html", "data-scene"),
        ("trajectory.ros2.yaml", "\"wrist_3_joint\""),
        ("trajectory.script", "servoj(["),
        ("waypoints.csv", "t_s,shoulder_pan_joint,"),
    ] {
        assert!(std::fs::read_to_string(folder.path().join("out").join(file)).unwrap().contains(holds), "{file}");
    }

    let ran = run(folder.path(), &["--threads", "2", "--seed", "4"]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stdout.lines().all(|line| line.chars().count() <= 80), "{}", ran.stdout);
    assert!(ran.stdout.contains("feasible: every limit is kept"), "{}", ran.stdout);
    let mut second = written(folder.path());
    for file in [&mut first, &mut second] {
        let file = file.as_object_mut().unwrap();
        file.remove("cpu_s");
        file.remove("seconds");
    }
    assert_eq!(first, second);
}

#[test]
fn what_cannot_be_kept_has_status_1_and_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    // The tool cannot be 5 m above the base: no motion keeps this limit at any speed.
    study(folder.path(), SMALL, 10.0);
    let path = folder.path().join("study.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, format!("{text}floor = {{ height_m = 5.0, points = [{{ link = \"tool0\" }}] }}\n")).unwrap();
    let ran = run(folder.path(), &["--to", "ros2"]);
    assert_eq!(ran.status, 1, "{}\n{}", ran.stdout, ran.stderr);
    assert!(ran.stdout.contains("NOT FEASIBLE"), "{}", ran.stdout);
    let file = written(folder.path());
    assert_eq!(file["feasible"], false);
    let diagnosis = file["diagnosis"].to_string();
    assert!(diagnosis.contains("The floor limit of") && diagnosis.contains("tool0"), "{diagnosis}");
    assert!(!folder.path().join("out/trajectory.ros2.yaml").exists(), "a robot would be sent through the floor");
}

#[test]
fn bad_input_is_named_before_any_search() {
    for (design, acceleration, named) in [
        ("duration_s = 0.0", 10.0, "duration_s = 0"),
        ("duration_s = nan", 10.0, "duration_s = NaN"),
        ("duration_s = 0.1", 1.0, "0.1 s is too short"),
        ("search = { rate_hz = -1.0 }", 10.0, "search.rate_hz = -1"),
        ("search = { starts = 0 }", 10.0, "search.starts = 0"),
        ("search = { startz = 1 }", 10.0, "startz"),
        ("torque_std_nm = [1.0, 2.0]", 10.0, "torque_std_nm has 2 entries, the robot 6 joints"),
        ("torque_std_nm = 0.0", 10.0, "torque_std_nm = 0"),
        ("torque_std_nm = \"small\"", 10.0, "standard deviation in Nm"),
        ("family = { kind = \"fourier\", harmonics = 1 }", 10.0, "harmonics"),
        ("family = { kind = \"spline\" }", 10.0, "unknown variant `spline`"),
        ("family = { kind = \"b-spline\", harmonics = 5 }", 10.0, "unknown field `harmonics`"),
        ("criterion = \"best\"", 10.0, "unknown variant `best`"),
        ("", -1.0, "must be above 0"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        study(folder.path(), design, acceleration);
        let ran = run(folder.path(), &[]);
        assert_eq!(ran.status, 2, "{design}: {}", ran.stderr);
        assert!(ran.stderr.contains(named) && ran.stderr.contains("study.toml"), "{design}: {}", ran.stderr);
        assert!(!folder.path().join("out").exists(), "{design} left something behind");
    }
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), SMALL, 10.0);
    let path = folder.path().join("study.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("\"elbow_joint\"", "\"ellbow\"")).unwrap();
    let ran = run(folder.path(), &[]);
    assert!(ran.status == 2 && ran.stderr.contains("`ellbow`"), "{}", ran.stderr);
}

#[test]
fn torque_limits_need_inertial_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(crate::common::broken().join("arm.urdf")).unwrap();
    let mut bare = String::new();
    let mut rest = urdf.as_str();
    while let Some((before, behind)) = rest.split_once("<inertial>") {
        bare.push_str(before);
        rest = behind.split_once("</inertial>").unwrap().1;
    }
    bare.push_str(rest);
    std::fs::write(folder.path().join("arm.urdf"), bare).unwrap();
    let study = "[robot]\nfile = \"arm.urdf\"\n";
    std::fs::write(folder.path().join("study.toml"), study).unwrap();
    let ran = run(folder.path(), &[]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("`shoulder` has no limit of speed"), "{}", ran.stderr);
    let limited =
        "[design.limits]\njoints = [{ joint = \"shoulder\", torque = 30.0 }, { joint = \"elbow\", torque = 9.0 }]\n";
    std::fs::write(folder.path().join("study.toml"), format!("{study}{limited}")).unwrap();
    let ran = run(folder.path(), &[]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("torque limit") && ran.stderr.contains("are unknown"), "{}", ran.stderr);
}

#[test]
fn a_format_that_cannot_be_written_is_refused_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "search = { starts = 100000 }", 10.0);
    let ran = run(folder.path(), &["--to", "urscript", "--rate-hz", "1000"]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("urscript") && ran.stderr.contains("500"), "{}", ran.stderr);
    let text = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let locked = text.replace("[drive]", "lock = { wrist_3_joint = 0.0 }\n[drive]");
    let joint = "{ joint = \"wrist_3_joint\", acceleration = 10.0 }";
    std::fs::write(folder.path().join("study.toml"), locked.replace(joint, "")).unwrap();
    let ran = run(folder.path(), &["--to", "urscript"]);
    assert_eq!(ran.status, 2, "{}", ran.stderr);
    assert!(ran.stderr.contains("urscript") && ran.stderr.contains("the robot has 5"), "{}", ran.stderr);
    assert!(!folder.path().join("out/design.json").exists());
}

#[test]
fn what_was_not_checked_stands_beside_feasible() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), SMALL, 10.0);
    let ran = run(folder.path(), &[]);
    assert_eq!(ran.status, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("NOT checked:\n  floor (defaults.floor is off)"), "{}", ran.stdout);
    assert!(ran.stdout.contains("self-collision") && !ran.stdout.contains("assumed:"), "{}", ran.stdout);
    let file = written(folder.path());
    assert!(file["not_checked"].as_array().unwrap().len() >= 3 && file["assumed"].as_array().unwrap().is_empty());
}
