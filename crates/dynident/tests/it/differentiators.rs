//! `identify` with every differentiator: noise-free logs give the true parameters, exactly if the differentiator is
//! exact for the motion, otherwise approximately.
use crate::common::{Job, Motion, Truth, assert_recovered, header, plain, repository, write_log};
use dynident::dynamics::Workspace;
use dynident::recording::LogisticPath;
use dynident::{Error, identify};
use std::fmt::Write;
use std::path::Path;

/// Sample rate, Hz, and duration, s: not multiples of the motion's period, so that no result is exact by accident.
const CLOCK: (f64, f64) = (100.0, 25.0);

fn ur10() -> String {
    repository("robots/ur10.urdf").display().to_string()
}

fn truth() -> Truth {
    Truth::near(&repository("robots/ur10.urdf"), 0.2, false)
}

/// Writes the motion `lead_s` ahead, as `design` does.
fn write_reference(path: &Path, motion: &Motion, lead_s: f64) {
    let mut text = "t_s".to_owned();
    for name in ["q", "dq", "ddq"] {
        (1..=6).for_each(|joint| write!(text, ",{name}{joint}").unwrap());
    }
    for k in 0..2700 {
        let t = f64::from(k) / CLOCK.0;
        write!(text, "\n{t}").unwrap();
        motion.at(t + lead_s).iter().flatten().for_each(|x| write!(text, ",{x}").unwrap());
    }
    std::fs::write(path, text + "\n").unwrap();
}

fn study(differentiator: &str, further: &str) -> String {
    format!(
        r#"
        robot.file = {:?}
        [motion]
        differentiator = {{ {differentiator} }}
        {further}
        [drive]
        friction = "stated"
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..6}}" }}
        torque = {{ columns = "tau{{1..6}}" }}
        [[log]]
        file = "log.csv"
        "#,
        ur10()
    )
}

#[test]
fn ways_that_are_exact_for_the_motion_give_the_truth_back() {
    let (folder, truth, motion) = (tempfile::tempdir().unwrap(), truth(), Motion::new(6, 1));
    write_log(&folder.path().join("log.csv"), &truth, &motion, CLOCK, &header(6), plain);
    write_reference(&folder.path().join("same.csv"), &motion, 0.0);
    write_reference(&folder.path().join("ahead.csv"), &motion, 0.04);
    for (differentiator, tolerance) in [
        // The motion is five harmonics of 0.13 Hz: only rounding and the condition number remain, as with differences
        // of order eight.
        ("method = \"fourier-fit\", base_hz = 0.13, harmonics = 5, trend = false", 1e-6),
        // No deviation; quintics are exact at the samples.
        (
            "method = \"deviation\", reference = \"same.csv\", smoother = { method = \"butterworth\", cutoff_hz = 0.3 }",
            1e-6,
        ),
        // The lag lies between samples: quintics of a 0.65 Hz motion at 100 Hz have a relative error of (0.04)⁴/100 =
        // 3e-8 in acceleration, the lag 1e-9 s.
        ("method = \"time-warp\", reference = \"ahead.csv\"", 1e-4),
        (
            "method = \"deviation\", max_lag_s = 0.2, reference = \"ahead.csv\", smoother = { method = \"butterworth\", cutoff_hz = 0.3 }",
            1e-4,
        ),
    ] {
        let job = Job::new(folder.path(), &study(differentiator, ""));
        let found = job.identify();
        assert_eq!(found.result.method.status, "complete", "{differentiator}");
        assert_recovered(&found, &truth.base_values(&job.robot()), tolerance);
    }
}

#[test]
fn ways_that_filter_come_near() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), plain);
    for (differentiator, percent) in [
        // Effect of a differentiator on motion up to 0.65 Hz: a delay of 2.6/(2π 20) s gives ωδ up to 8 % of torques
        // that are mostly gravity; the others use an automatic cut-off.
        ("method = \"low-pass\", cutoff_hz = 20.0", 5.0),
        ("method = \"frequency-domain\"", 1.0),
        ("method = \"smoothed-differences\", window = 11", 1.0),
        ("method = \"five-point-cubic\", passes = 3", 1.0),
        ("method = \"speed-series\", base_hz = 0.13, harmonics = 5", 1.0),
    ] {
        let job = Job::new(folder.path(), &study(differentiator, "trim_s = 2.0"));
        let found = job.identify();
        let error = found.result.training.relative_error_percent.unwrap();
        assert!(error < percent, "{differentiator}: {error} %");
    }
}

/// The same causal filter delays torque and motion equally; the remaining error is due to the nonlinearity of friction
/// and rigid bodies.
#[test]
fn smoothing_the_torque_alike_takes_the_delay_out() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), CLOCK, &header(6), plain);
    let error = |further: &str| {
        let differentiator = "method = \"low-pass\", cutoff_hz = 10.0";
        let job = Job::new(folder.path(), &study(differentiator, &format!("trim_s = 2.0\n{further}")));
        job.identify().result.training.relative_error_percent.unwrap()
    };
    // 42 ms delay at 10 Hz: ωδ up to 0.17. The second filter has no delay, and its gain at 0.65 Hz is 1 within 1e-9;
    // the delay of nonlinear terms is of second order in ωδ.
    let (late, alike) = (error("torque_lag_s = 0.0"), error("smooth_torque = true\ntorque_lag_s = 0.0"));
    assert!(alike < 0.2 * late, "{late} % and {alike} %");
    // With an unstated lag, the delay of the motion is found as a torque lag and compensated.
    let found = error("smooth_torque = false");
    assert!(found < 0.2 * late, "{late} % and {found} %");
}

#[test]
fn a_log_has_its_own_reference_and_joints_their_own_order() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    for seed in [1, 2] {
        let motion = Motion::new(6, seed);
        write_log(&folder.path().join(format!("log{seed}.csv")), &truth, &motion, CLOCK, &header(6), plain);
        write_reference(&folder.path().join(format!("ref{seed}.csv")), &motion, -0.3);
    }
    let names: Vec<String> = dynident::model::load_robot(repository("robots/ur10.urdf"))
        .unwrap()
        .model
        .joints()
        .iter()
        .rev()
        .map(|joint| joint.name.clone())
        .collect();
    let backwards = |name: &str| (1..=6).rev().map(|j| format!("{name}{j}")).collect::<Vec<_>>();
    let text = format!(
        r#"
        robot = {{ file = {:?}, joints = {names:?} }}
        [motion]
        differentiator = {{ method = "time-warp", reference = {{ file = "ref1.csv", start_s = -0.31 }} }}
        [drive]
        friction = "stated"
        [format]
        time = {{ column = "t" }}
        position = {{ columns = {:?} }}
        torque = {{ columns = {:?} }}
        [[log]]
        file = "log1.csv"
        [[log]]
        file = "log2.csv"
        reference = {{ file = "ref2.csv", start_s = -0.29 }}
        role = "validate"
        "#,
        ur10(),
        backwards("q"),
        backwards("tau")
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    assert_recovered(&found, &truth.base_values(&job.robot()), 1e-4);
    // Parameter errors of at most 1e-4.
    assert!(found.result.validation[0].model.relative_error_percent.unwrap() < 0.01);

    // With the reference of the first log for both, the second log does not follow it and is named.
    let wrong = text.replace("reference = { file = \"ref2.csv\", start_s = -0.29 }\n", "");
    let job = Job::new(folder.path(), &wrong);
    let worse = match identify(&job.study, &job.path, &Job::options(1)) {
        Ok(found) => found.result.validation[0].model.relative_error_percent.unwrap() > 5.0,
        Err(error) => error.to_string().contains("time-warp"),
    };
    assert!(worse);
}

#[test]
fn a_way_without_its_reference_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    write_log(&folder.path().join("log.csv"), &truth(), &Motion::new(6, 1), (100.0, 2.0), &header(6), plain);
    let message = |differentiator: &str| -> String {
        let job = Job::new(folder.path(), &study(differentiator, ""));
        let error: Error = identify(&job.study, &job.path, &Job::options(1)).unwrap_err();
        error.to_string()
    };
    assert!(message("method = \"time-warp\"").contains("reference = \"trajectory.csv\""));
    let missing = message("method = \"deviation\", reference = \"nowhere.csv\"");
    assert!(missing.contains("nowhere.csv"), "{missing}");
    let one = "method = \"logistic-map\", reference = { joints = [{ amplitude = 1.0, omega = 1.0, offset = 0.0, period_s = 40.0 }] }";
    assert!(message(one).contains("the reference moves 1 joints, but the robot has 6"), "{}", message(one));
}

/// The paper's arm with the paper's strokes, both joints delayed: the map is exact for a pure delay.
#[test]
fn the_papers_map_identifies_the_planar_arm_through_a_lag() {
    let folder = tempfile::tempdir().unwrap();
    let robot = repository("robots/planar2r.urdf");
    let truth = Truth::near(&robot, 0.2, false);
    let paths = [(1.9, 1.0, -0.4, 40.0), (2.0, 1.25, -1.0, 32.0)].map(|(amplitude, omega, offset, period_s)| {
        LogisticPath { amplitude, omega, offset, period_s, repetitions: 1 }
    });
    let mut workspace = Workspace::new(&truth.model);
    let mut text = header(2);
    for k in 0..4000 {
        let t = f64::from(k) / 100.0;
        let states = [0, 1].map(|joint| paths[joint].at(t - [0.08, 0.05][joint]));
        let [q, dq, ddq] = [0, 1, 2].map(|order| states.iter().map(|state| state[order]).collect::<Vec<_>>());
        let tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        write!(text, "\n{t},{},{},{},{}", q[0], q[1], tau[0], tau[1]).unwrap();
    }
    std::fs::write(folder.path().join("log.csv"), text + "\n").unwrap();
    let joints: Vec<String> = paths
        .iter()
        .map(|path| {
            let LogisticPath { amplitude, omega, offset, period_s, .. } = path;
            format!("{{ amplitude = {amplitude:?}, omega = {omega:?}, offset = {offset:?}, period_s = {period_s:?} }}")
        })
        .collect();
    let text = format!(
        r#"
        robot.file = {:?}
        [motion]
        differentiator = {{ method = "logistic-map", reference = {{ joints = [{}] }} }}
        [drive]
        friction = "stated"
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..2}}" }}
        torque = {{ columns = "tau{{1..2}}" }}
        [[log]]
        file = "log.csv"
        "#,
        robot.display().to_string(),
        joints.join(", ")
    );
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    // Outside of the strokes the velocity is that of the reference, with errors up to 1e-3 of its peak near the
    // splices; the friction step is 0.02 rad/s wide.
    assert_recovered(&found, &truth.base_values(&job.robot()), 1e-2);
}
