//! The report of an iteration: plots of every run and joint, rejected runs, escaped names.
use crate::common::{assert_reads_back, repository};
use core::fmt::Write;
use core::ops::ControlFlow;
use dynident::{IterationWatch, IterationsFile, ResultFile, RunOptions, Silent, Study, iterate_study, validate};
use std::path::Path;

const NAME: &str = "elbow</script><b>&quot;";

/// Two joints, each with a motion of two sines from rest.
fn write(folder: &Path, more: &str) {
    let urdf = std::fs::read_to_string(repository("robots/planar2r.urdf")).unwrap();
    let escaped = NAME.replace('&', "&amp;").replace('<', "&lt;");
    std::fs::write(folder.join("robot.urdf"), urdf.replace("\"joint2\"", &format!("\"{escaped}\""))).unwrap();
    let mut table = String::from("t_s,q1,q2,dq1,dq2,ddq1,ddq2\n");
    for sample in 0..=800 {
        let t = f64::from(sample) * 0.01;
        // A (1 - cos ωt): value, velocity, acceleration.
        let rise = |a: f64, w: f64| [a * (1.0 - (w * t).cos()), a * w * (w * t).sin(), a * w * w * (w * t).cos()];
        let sum = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        let (one, two) = (sum(rise(0.4, 1.0), rise(0.2, 2.3)), sum(rise(-0.5, 1.4), rise(0.2, 3.1)));
        let [q, dq, ddq] = [0, 1, 2].map(|k| format!("{},{}", one[k], two[k]));
        writeln!(table, "{t},{q},{dq},{ddq}").unwrap();
    }
    std::fs::write(folder.join("motion.csv"), table).unwrap();
    let text = format!(
        r#"
        name = "two joints </title>"
        robot.file = "robot.urdf"
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
        {more}
        "#
    );
    std::fs::write(folder.join("study.toml"), text).unwrap();
}

fn iterated(folder: &Path, more: &str) -> (IterationsFile, String) {
    write(folder, more);
    let path = folder.join("study.toml");
    let study = Study::load(&path).unwrap();
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    let out = folder.join("out");
    let file = iterate_study(&study, &path, &out, true, &options, &mut watch).unwrap();
    assert_reads_back(&file);
    // A second call makes no run and plots the existing logs.
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    let again = iterate_study(&study, &path, &out, true, &options, &mut watch).unwrap();
    assert_eq!(again.runs.len(), file.runs.len());
    let curves = |page: &str| page.matches("data-plot=\"plot-").count();
    assert_eq!(curves(&std::fs::read_to_string(out.join("report.html")).unwrap()), curves(&page));
    (file, page)
}

#[test]
fn every_run_and_joint_is_drawn_and_no_name_becomes_markup() {
    let folder = tempfile::tempdir().unwrap();
    let (file, page) = iterated(
        folder.path(),
        "[iteration]\ntrajectory = \"motion.csv\"\nmodel_free = { kind = \"joint-pd\", kp = 20.0, kd = 4.0 }",
    );
    assert!(file.converged, "{}", file.reason);
    // The controller of the second run has the model of the first.
    assert_eq!(file.runs.iter().map(|run| run.model_of_run).collect::<Vec<_>>()[..2], [None, Some(1)]);
    for heading in ["Runs", "Tracking", "Parameters", "Time"] {
        assert!(page.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    assert!(!page.contains(NAME) && !page.contains("</script><b>") && !page.contains("joints </title>"));
    // Largest errors, one plot per joint, logged and commanded torque per joint, two of parameter errors, and one per
    // unit (kg m, kg m²).
    let plots = page.matches("data-plot=\"plot-").count();
    assert_eq!(plots, 1 + 2 + 2 + 2 + 2);
    for text in ["from run 1", "the truth", "converged", "Cramér-Rao", "run 2"] {
        assert!(page.contains(text), "{text}");
    }
}

/// An arm that cannot follow: no parameters, and the reason of every run.
#[test]
fn a_refused_iteration_says_why_run_by_run() {
    let folder = tempfile::tempdir().unwrap();
    let (file, page) = iterated(
        folder.path(),
        "limits = { tracking_error = 1e-3 }\n[iteration]\ntrajectory = \"motion.csv\"\nmodel_free = { kind = \"joint-pd\", kp = 1.0, kd = 1.0 }",
    );
    assert_eq!(file.status, "refused");
    assert_eq!(page.matches("run 1: stopped").count(), 1);
    assert!(
        page.contains("No run determines the parameters") && page.contains("rejected") && page.contains("gains times")
    );
}

/// An iteration ends with the robot from all accepted runs, like `identify`, and `validate` reads it.
#[test]
fn an_iteration_ends_with_the_robot_it_found() {
    let folder = tempfile::tempdir().unwrap();
    let settings =
        "[iteration]\ntrajectory = \"motion.csv\"\nmodel_free = { kind = \"joint-pd\", kp = 20.0, kd = 4.0 }";
    let (file, page) = iterated(folder.path(), settings);
    let out = folder.path().join("out");
    assert_eq!((file.converged, file.unmet.len(), &file.no_result), (true, 0, &None), "{}", file.reason);
    assert!(file.status_line().contains("converged") && !file.status_line().contains('\n'));
    let result = ResultFile::read(&out.join("result.json")).unwrap();
    assert!(result.problems.is_empty(), "{:?}", result.problems);
    let good: Vec<String> = file.runs.iter().filter(|run| run.accepted).map(|run| format!("run {}", run.run)).collect();
    assert_eq!(result.training.logs, good);
    // Unused rows at the ends must not shift later rows: a shift by one row would be a lag.
    let row_s = result.logs[0].filtered_rate_hz.recip();
    for lag in result.joints.iter().filter_map(|joint| joint.torque_lag) {
        assert!(lag.lag_s.abs() < 0.5 * row_s, "{lag:?}");
    }
    // The pooled parameters of the last run, with names on the page.
    let last = file.runs.last().unwrap();
    assert_eq!(result.base_parameters.len(), last.pooled.len());
    for (one, pooled) in result.base_parameters.iter().zip(&last.pooled) {
        assert_eq!((one.value, &one.symbol), (pooled.value, &pooled.symbol));
        // The covariance has another order of summation, so the last bits differ.
        assert!((one.std / pooled.std.unwrap() - 1.0).abs() < 1e-12, "{one:?}");
        assert!(page.contains(&one.symbol), "{}", one.symbol);
    }
    let urdf = std::fs::read_to_string(out.join("identified.urdf")).unwrap();
    assert!(urdf.contains(&result.provenance.as_ref().unwrap().identity));
    let text = std::fs::read(out.join("controller.json")).unwrap();
    let controller: serde_json::Value = serde_json::from_slice(&text).unwrap();
    // The controller's model is the robot of the result.
    let mass = &controller["model"]["joints"][0]["inertial"][0];
    assert!((mass.as_f64().unwrap() - result.bodies[0].mass_kg).abs() < 1e-12);
    assert!(std::fs::read_to_string(out.join("identification.html")).unwrap().contains("</html>"));
    // A log of the iteration can be used like any log.
    let study = folder.path().join("test.toml");
    let text = std::fs::read_to_string(folder.path().join("study.toml")).unwrap();
    let (head, _) = text.split_once("[iteration]").unwrap();
    let log = r#"
        [format]
        time = { column = "t_s" }
        position = { columns = "q{1..2}" }
        torque = { columns = "tau{1..2}" }
        [[log]]
        file = "out/runs/run_2/log.csv"
        "#;
    std::fs::write(&study, format!("{head}\n[parallel_filter]\ncutoff_hz = 5.0\nfactor = 20\n{log}")).unwrap();
    let options = RunOptions { data: None, threads: 1, progress: &Silent };
    let tested = validate(&out.join("result.json"), &Study::load(&study).unwrap(), &study, &options).unwrap();
    let percent = tested.validation[0].model.relative_error_percent.unwrap();
    assert!(percent < 1.0, "{percent}");
    // A failed fresh start leaves no files of an earlier robot.
    write(folder.path(), &format!("limits = {{ tracking_error = 1e-3 }}\n{}", settings.replace("20.0", "1.0")));
    let path = folder.path().join("study.toml");
    let mut hear = |_: &_, _: &[_]| {};
    let mut watch = IterationWatch::new(&|_| ControlFlow::Continue(()), &mut hear);
    let refused = iterate_study(&Study::load(&path).unwrap(), &path, &out, false, &options, &mut watch).unwrap();
    assert_eq!(refused.status, "refused");
    for name in ["result.json", "identified.urdf", "controller.json", "identification.html"] {
        assert!(!out.join(name).exists(), "{name}");
    }
}
