//! `iterate` in a folder with existing files: resumed or refused, and nothing is lost.

use crate::common::run_in;
use std::fmt::Write;
use std::path::Path;

/// The planar arm along two sines per joint, from rest, in simulation.
fn study(folder: &Path, iteration: &str) {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf");
    let mut table = String::from("t_s,q1,q2,dq1,dq2,ddq1,ddq2\n");
    for sample in 0..=800 {
        let t = f64::from(sample) * 0.01;
        let rise = |a: f64, w: f64| [a * (1.0 - (w * t).cos()), a * w * (w * t).sin(), a * w * w * (w * t).cos()];
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let (one, two) = (sum(rise(0.4, 1.0), rise(0.2, 2.3)), sum(rise(-0.5, 1.4), rise(0.2, 3.1)));
        let [q, dq, ddq] = [0, 1, 2].map(|k| format!("{},{}", one[k], two[k]));
        writeln!(table, "{t},{q},{dq},{ddq}").unwrap();
    }
    std::fs::write(folder.join("motion.csv"), table).unwrap();
    let text = format!(
        r#"
        robot.file = "{}"
        [drive]
        viscous = false
        coulomb = "none"
        offset = false
        [controller]
        kind = "finite-time"
        kp = 25.0
        kd = 10.0
        [simulation]
        rate_hz = 500.0
        off_percent = 20.0
        effort_limits = false
        integrator = {{ kind = "rk4" }}
        sensors = {{ torque_std = 0.01, seed = 1 }}
        [iteration]
        trajectory = "motion.csv"
        model_free = {{ kind = "joint-pd", kp = 80.0, kd = 12.0 }}
        {iteration}
        "#,
        urdf.display()
    );
    std::fs::write(folder.join("study.toml"), text).unwrap();
}

fn iterate(folder: &Path, further: &[&str]) -> (i32, String) {
    let arguments: Vec<&str> = ["iterate", "study.toml", "--out", "out"].iter().chain(further).copied().collect();
    let outcome = run_in(folder, &arguments);
    (outcome.status, format!("{}{}", outcome.stdout, outcome.stderr))
}

/// Suggested fixes keep the existing runs: more runs, another tolerance, slow runs, another name. Changed conditions of
/// the runs are another iteration, and the message names the table and the option.
#[test]
fn following_the_advice_keeps_the_runs() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    study(at, "max_runs = 1");
    let (status, words) = iterate(at, &[]);
    assert_eq!(status, 1, "{words}");
    assert!(words.contains("max_runs"), "{words}");
    let first = std::fs::read(at.join("out/runs/run_1/run.json")).unwrap();
    let advised = "max_runs = 6\nspeed_steps = [0.5, 1.0]\nsettled = { tracking_tolerance = 0.05, most_lag_s = 0.01 }\n\
                   rehearsal = { robots = 2 }";
    study(at, advised);
    let text = std::fs::read_to_string(at.join("study.toml")).unwrap();
    std::fs::write(at.join("study.toml"), format!("name = \"another\"\n{text}")).unwrap();
    let (status, words) = iterate(at, &[]);
    assert_eq!(status, 0, "{words}");
    assert_eq!(std::fs::read(at.join("out/runs/run_1/run.json")).unwrap(), first);
    assert!(at.join("out/runs/run_2/run.json").exists());
    std::fs::write(at.join("study.toml"), text.replace("kp = 25.0", "kp = 24.0")).unwrap();
    let (status, words) = iterate(at, &[]);
    assert_eq!(status, 2, "{words}");
    assert!(words.contains("[controller] differs") && words.contains("--fresh"), "{words}");
}

/// The exported controller has the envelope of its runs.
#[test]
fn the_controller_that_was_found_has_the_envelope() {
    let folder = tempfile::tempdir().unwrap();
    study(folder.path(), "max_runs = 2\nenvelope = { tracking_error = 0.9 }");
    iterate(folder.path(), &[]);
    let text = std::fs::read_to_string(folder.path().join("out/controller.json")).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(file["envelope"]["tracking_error"], serde_json::json!([0.9, 0.9]), "{}", file["envelope"]);
}

#[test]
fn a_refused_fresh_start_removes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    study(at, "max_runs = 2");
    iterate(at, &[]);
    let names = ["result.json", "identified.urdf", "controller.json", "iterations.json", "report.html"];
    assert!(names.iter().all(|name| at.join("out").join(name).exists()));
    std::fs::write(at.join("out/runs/run_1/notes.txt"), "cable loose").unwrap();
    let (status, words) = iterate(at, &["--fresh"]);
    assert_eq!(status, 2, "{words}");
    assert!(words.contains("notes.txt"), "{words}");
    for name in names {
        assert!(at.join("out").join(name).exists(), "{name}");
    }
}

/// A result of `identify` in the same folder is kept until the iteration has its own result.
#[test]
fn a_result_of_identify_stays_until_there_is_another() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let names = ["result.json", "identified.urdf", "report.html"];
    std::fs::create_dir(at.join("out")).unwrap();
    for name in names {
        std::fs::write(at.join("out").join(name), "of identify").unwrap();
    }
    let theirs = |name: &&str| std::fs::read(at.join("out").join(name)).is_ok_and(|text| text == b"of identify");
    // No run is good: gains that let the arm fall.
    let falls = "max_runs = 2\nenvelope = { tracking_error = 1e-4 }";
    study(at, falls);
    for further in [&[][..], &["--fresh"]] {
        let (status, words) = iterate(at, further);
        assert_eq!(status, 1, "{words}");
        // The report is already that of the iteration.
        assert!(names[..2].iter().all(theirs), "{words}");
    }
    study(at, "max_runs = 2");
    let (_, words) = iterate(at, &["--fresh"]);
    assert!(!names.iter().any(theirs), "{words}");
    let result = std::fs::read_to_string(at.join("out/result.json")).unwrap();
    assert!(result.contains("base_parameters"));
}
