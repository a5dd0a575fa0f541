//! `[iteration] home`: home posture, approach paths, held-out motion and warm-up.

use crate::common::repository;
use core::ops::ControlFlow;
use dynident::{Error, IterationWatch, IterationsFile, RunOptions, Silent, Study, iterate_study};
use std::path::Path;

fn iterated(folder: &Path, text: &str) -> Result<IterationsFile, Error> {
    let path = folder.join("study.toml");
    std::fs::write(&path, text).unwrap();
    let study = Study::load(&path).unwrap();
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    iterate_study(&study, &path, &folder.join("out"), false, &options, &mut watch)
}

/// Three seconds of sines of the planar arm, from rest to rest, under joint PD; one run.
fn study(folder: &Path, design: &str, iteration: &str) -> String {
    let mut rows = vec!["t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned()];
    rows.extend((0..=300).map(|k| {
        let (t, w) = (f64::from(k) * 0.01, core::f64::consts::TAU / 3.0);
        let [q, dq, ddq] = [0.2 * (1.0 - (w * t).cos()), 0.2 * w * (w * t).sin(), 0.2 * w * w * (w * t).cos()];
        format!("{t},{q},{},{dq},{},{ddq},{}", 0.5 + 2.0 * q, 2.0 * dq, 2.0 * ddq)
    }));
    std::fs::write(folder.join("sines.csv"), rows.join("\n") + "\n").unwrap();
    format!(
        "[robot]\nfile = \"{}\"\n[simulation]\nrate_hz = 500.0\n[design.defaults]\nfloor = false\n{design}\n[controller]\nkind = \"pd-gravity\"\nkp = [200.0, 60.0]\nkd = [20.0, 4.0]\n\
         [iteration]\ntrajectory = \"sines.csv\"\nmax_runs = 1\nstart = \"prior\"\n{iteration}\n",
        repository("robots/planar2r.urdf").display()
    )
}

fn positions(log: &Path) -> Vec<[f64; 2]> {
    let text = std::fs::read_to_string(log).unwrap();
    let row = |line: &str| -> Vec<f64> { line.split(',').map(|field| field.parse().unwrap()).collect() };
    text.lines().skip(1).map(row).map(|row| [row[1], row[2]]).collect()
}

#[test]
fn a_study_says_where_its_robot_waits() {
    let folder = tempfile::tempdir().unwrap();
    let home = "home = { joint2 = -0.3, joint1 = 0.6 }";
    let file = iterated(folder.path(), &study(folder.path(), "", home)).unwrap();
    assert_eq!(file.runs[0].outcome, "done");
    let run = folder.path().join("out/runs/run_1");
    let (approach, back) = (positions(&run.join("approach_log.csv")), positions(&run.join("return_log.csv")));
    assert_eq!(approach[0], [0.6, -0.3]);
    let last = back[back.len() - 1];
    assert!((last[0] - 0.6).abs() < 0.02 && (last[1] + 0.3).abs() < 0.02, "{last:?}");
    // The log of the run contains only the motion.
    let motion = positions(&run.join("log.csv"));
    assert!(motion.len() == 1501 && (motion[0][1] - 0.5).abs() < 0.02, "{}", motion.len());
    // At a fifth of 5 rad/s, and of 62.5 rad/s^2 (full speed after 0.2 rad) for 0.8 rad: 1.875 · 0.8 / 1 s.
    assert!(approach.len() >= 750 && approach.len() < 751 + 100, "{}", approach.len());
    let fast = iterated(folder.path(), &study(folder.path(), "", &format!("{home}\napproach_speed = 0.5"))).unwrap();
    assert_eq!(fast.runs[0].outcome, "done");
    assert!(positions(&run.join("approach_log.csv")).len() < approach.len());
}

/// The limits of `[design]` apply to the approach, and errors are reported before any run.
#[test]
fn what_is_wrong_with_a_home_is_said() {
    let folder = tempfile::tempdir().unwrap();
    // Half-way the tip is at -0.4 sin(2.4) - 0.5 sin(1.2) = -0.74 m.
    let floor = "[design.limits]\nfloor = { height_m = -0.7, points = [{ link = \"link2\", at_m = [0.4, 0.0, 0.0] }] }";
    let home = "home = [2.4, 0.0]";
    let free = iterated(folder.path(), &study(folder.path(), "", home)).unwrap();
    assert_eq!(free.runs[0].outcome, "done");
    let around = iterated(folder.path(), &study(folder.path(), floor, home)).unwrap();
    assert_eq!(around.runs[0].outcome, "done");
    let lowest = positions(&folder.path().join("out/runs/run_1/approach_log.csv"))
        .into_iter()
        .map(|[a, b]| -0.5 * a.sin() - 0.4 * (a + b).sin())
        .fold(f64::INFINITY, f64::min);
    // The tracking error is some mrad.
    assert!(lowest > -0.71, "{lowest}");
    let high = floor.replace("-0.7", "-0.2");
    let refused = iterated(folder.path(), &study(folder.path(), &high, "home = [1.0, 0.0]")).unwrap();
    assert!(refused.runs.is_empty() && refused.status == "refused");
    assert!(refused.reason.contains("home itself breaks the limit of floor of link2"), "{}", refused.reason);
    let wrong =
        |iteration: &str| iterated(folder.path(), &study(folder.path(), "", iteration)).unwrap_err().to_string();
    let error = wrong("home = { joint1 = 0.2 }");
    assert!(error.contains("home.joint2") && error.contains("every joint"), "{error}");
    let error = wrong("home = [0.2]");
    assert!(error.contains("home") && error.contains('2'), "{error}");
    let error = wrong("home = { elbow = 0.2, joint1 = 0.0, joint2 = 0.0 }");
    assert!(error.contains("elbow") && error.contains("joint2"), "{error}");
    let error = wrong("home = [0.2, 0.1]\napproach_speed = 2.0");
    assert!(error.contains("approach_speed"), "{error}");
    let error = wrong("home = [0.2, 0.1]\nleg = [{ hold = { joint1 = 0.0 } }]");
    assert!(error.contains("locked = false"), "{error}");
    // There is no warm-up with a robot behind a folder.
    let error = wrong(
        "warm_up_s = 60.0\nmodel_free = { kind = \"joint-pd\", kp = 400.0, kd = 40.0 }\nrobot = { kind = \"folder\", folder = \"exchange\" }",
    );
    assert!(error.contains("warm_up_s") && error.contains("before you record"), "{error}");
}

/// The held-out motion validates the model and the identified robot, and is reported.
#[test]
fn a_held_out_motion_judges_and_tests() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = vec!["t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned()];
    rows.extend((0..=400).map(|k| {
        let (t, w) = (f64::from(k) * 0.01, core::f64::consts::TAU / 2.0);
        let [q, dq, ddq] = [0.1 * (1.0 - (w * t).cos()), 0.1 * w * (w * t).sin(), 0.1 * w * w * (w * t).cos()];
        format!("{t},{},{q},{},{dq},{},{ddq}", 0.2 - 2.0 * q, -2.0 * dq, -2.0 * ddq)
    }));
    std::fs::write(folder.path().join("other.csv"), rows.join("\n") + "\n").unwrap();
    let with = |held_out: &str| {
        study(folder.path(), "", &format!("held_out = {held_out}"))
            .replace("rate_hz = 500.0", "rate_hz = 500.0\nsensors = { torque_std = 0.02 }")
    };
    let file = iterated(folder.path(), &with("{ every = 1, trajectory = \"other.csv\" }")).unwrap();
    let judged = file.runs[0].held_out.as_ref().unwrap();
    assert!(judged.done && judged.max_tracking_error_rad.len() == 2, "{}", judged.outcome);
    let joints = &judged.evidence.as_ref().unwrap().joints;
    assert!(joints.iter().all(|joint| joint.prediction.unwrap().rows > 100));
    let out = folder.path().join("out");
    assert!(out.join("runs/held_out_1/log.csv").is_file());
    assert!(
        std::fs::read_to_string(out.join("report.html")).unwrap().contains("of the held-out motion the model holds")
    );
    let result: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("result.json")).unwrap()).unwrap();
    let tested = result["logs"].as_array().unwrap().iter().find(|log| log["role"] == "validate").unwrap();
    assert!(tested["import"]["file"].as_str().unwrap().ends_with("out/runs/held_out_1/log.csv"), "{tested}");
    let wrong = |held_out: &str| iterated(folder.path(), &with(held_out)).unwrap_err().to_string();
    // Without a design no other motion can be designed.
    let text = with("{}").replace("[design.defaults]\nfloor = false\n", "");
    let error = iterated(folder.path(), &text).unwrap_err().to_string();
    assert!(error.contains("held_out.trajectory") && error.contains("[design]"), "{error}");
    let error = wrong("{ every = 0, trajectory = \"other.csv\" }");
    assert!(error.contains("held_out.every"), "{error}");
    let error = wrong("{ trajectory = \"other.csv\", design = {} }");
    assert!(error.contains("held_out.design"), "{error}");
    let error = wrong("{ trajectory = \"other.csv\" }\nleg = [{ hold = { joint1 = 0.0 } }]");
    assert!(error.contains("one motion"), "{error}");
}

/// The warm-up is in the result and on the page, with the number of passes and the change of friction.
#[test]
fn a_warm_up_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let text = study(folder.path(), "", "warm_up_s = 5.0").replace("rate_hz = 500.0", "rate_hz = 500.0\nviscous = 1.0");
    let file = iterated(folder.path(), &text).unwrap();
    // The motion lasts 3 s.
    let shown = file.runs[0].warm_up.as_ref().unwrap();
    assert!(shown.passes == 2 && shown.lost_power_w[0] > 0.0, "{shown:?}");
    assert!(shown.change_percent().unwrap().abs() < 0.1);
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(page.contains("warmed up with its motion 2 times, 6 s"));
    assert!(IterationsFile::read(&folder.path().join("out/iterations.json")).unwrap().runs[0].warm_up.is_some());
}
