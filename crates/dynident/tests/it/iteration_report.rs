//! The report of an iteration: every run and joint drawn, rejected runs named, hostile names harmless.
use crate::common::{assert_reads_back, repository};
use core::fmt::Write;
use core::ops::ControlFlow;
use dynident::{IterationWatch, IterationsFile, RunOptions, Silent, Study, iterate_study};
use std::path::Path;

const NAME: &str = "elbow</script><b>&quot;";

/// Two joints, a motion of two sines each from rest, and a study around it.
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
    // A second call makes no run, and draws the same curves from the logs that are there.
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
    // The second run has the robot of the first.
    assert_eq!(file.runs.iter().map(|run| run.model_of_run).collect::<Vec<_>>()[..2], [None, Some(1)]);
    for heading in ["Runs", "Tracking", "Parameters", "Time"] {
        assert!(page.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    assert!(!page.contains(NAME) && !page.contains("</script><b>") && !page.contains("joints </title>"));
    // Largest errors, one plot a joint, two of the parameters' errors, and one for each unit (kg m, kg m²).
    let plots = page.matches("data-plot=\"plot-").count();
    assert_eq!(plots, 1 + 2 + 2 + 2);
    for text in ["of run 1", "the truth", "converged", "Cramér-Rao", "run 2"] {
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
    assert!(page.contains("No run determines the parameters") && page.contains("rejected") && page.contains("stiffer"));
}
