//! DIDIM, CLIE and CLOE in a study: logs of a simulated closed loop with noise, and messages for missing parts.
use crate::common::{Job, Motion, assert_reads_back, repository};
use core::ops::ControlFlow;
use dynident::{Error, IdentificationOutcome, identify, simulate_study};
use std::fmt::Write;
use std::path::Path;

const RATE_HZ: f64 = 1000.0;
const SECONDS: f64 = 4.0;

/// The commanded motion, as `design` writes it.
fn write_trajectory(path: &Path) {
    let motion = Motion::new(2, 3);
    let mut text = "t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned();
    for k in 0..=(RATE_HZ * SECONDS) as usize {
        let t = k as f64 / RATE_HZ;
        write!(text, "\n{t}").unwrap();
        motion.at(t).iter().flatten().for_each(|x| write!(text, ",{x}").unwrap());
    }
    std::fs::write(path, text + "\n").unwrap();
}

/// A study of the planar arm. Positions have a noise of 3e-4 rad, so accelerations below 30 Hz are mostly noise.
fn study(method: &str, controller: &str) -> String {
    format!(
        r#"
        robot.file = {:?}
        {controller}
        [estimator]
        method = "{method}"
        [simulation]
        rate_hz = {RATE_HZ:?}
        off_percent = 20.0
        viscous = 0.5
        coulomb = [0.8, 0.5]
        sensors = {{ position_std = 3e-4, torque_std = 0.3, record_rate_hz = 250.0, seed = 5 }}
        [iteration]
        trajectory = "trajectory.csv"
        [motion]
        trim_s = 0.5
        differentiator = {{ method = "butterworth", cutoff_hz = 30.0 }}
        [format]
        time = {{ column = "t_s" }}
        position = {{ columns = "q{{1..2}}" }}
        torque = {{ columns = "tau{{1..2}}" }}
        [[log]]
        file = "log.csv"
        reference = "trajectory.csv"
        "#,
        repository("robots/planar2r.urdf").display().to_string(),
    )
}

const CONTROLLER: &str = "[controller]\nkind = \"joint-pd\"\nkp = [1500.0, 250.0]\nkd = [100.0, 8.0]";

/// Writes trajectory and log; returns the true base parameters.
fn recorded(folder: &Path) -> Vec<f64> {
    write_trajectory(&folder.join("trajectory.csv"));
    let job = Job::new(folder, &study("weighted", CONTROLLER));
    let run = simulate_study(&job.study, &job.path, &Job::options(1), &|_| ControlFlow::Continue(())).unwrap();
    assert!(run.file.done, "{:?}", run.file.status);
    assert_reads_back(&run.file);
    std::fs::write(folder.join("log.csv"), run.log).unwrap();
    run.file.base_parameters.iter().map(|parameter| parameter.value).collect()
}

/// Root mean square error in units of `bars`.
fn score(found: &IdentificationOutcome, truth: &[f64], bars: &[f64]) -> f64 {
    let squares = (0..truth.len()).map(|i| ((found.estimate.values[i] - truth[i]) / bars[i]).powi(2));
    (squares.sum::<f64>() / truth.len() as f64).sqrt()
}

#[test]
fn all_three_find_the_truth_where_least_squares_is_biased() {
    let folder = tempfile::tempdir().unwrap();
    let truth = recorded(folder.path());
    let plain = Job::new(folder.path(), &study("weighted", CONTROLLER)).identify();
    for method in ["didim", "clie", "cloe"] {
        let job = Job::new(folder.path(), &study(method, CONTROLLER));
        let found = job.identify();
        let fit = found.result.simulated.as_ref().unwrap();
        assert_eq!((&*fit.controller, fit.rate_hz), ("joint-pd", RATE_HZ));
        let bars = &found.estimate.std;
        let (simulated, least_squares) = (score(&found, &truth, bars), score(&plain, &truth, bars));
        assert_eq!((&found.result.method.estimator[..], &found.result.method.status[..]), (method, "complete"));
        // Twelve squares with mean one: their root mean square is below 1.8 by four standard deviations; the jackknife
        // is conservative.
        assert!(simulated < 1.8, "{method}: {simulated}");
        assert!(least_squares > 3.0 * simulated, "{method}: {least_squares} and {simulated}");
    }
}

fn refused(folder: &Path, text: &str) -> String {
    let job = Job::new(folder, text);
    let error: Error = identify(&job.study, &job.path, &Job::options(1)).unwrap_err();
    error.to_string()
}

#[test]
fn what_cannot_be_simulated_is_said() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    for method in ["didim", "clie", "cloe"] {
        let message = refused(folder.path(), &study(method, ""));
        assert!(message.contains("[controller]") && message.contains(method), "{message}");
        // Sampled at 1 kHz, damping of 80000 Nm s/rad is unstable.
        let wild = CONTROLLER.replace("kd = [100.0, 8.0]", "kd = 80000.0");
        let wild = study(method, &wild).replace("off_percent", "effort_limits = false\noff_percent");
        let message = refused(folder.path(), &wild);
        assert!(message.contains("diverged") && message.contains("does not get through"), "{message}");
        let message =
            refused(folder.path(), &study(method, CONTROLLER).replace("reference = \"trajectory.csv\"\n", "\n"));
        assert!(message.contains("reference = ") && message.contains("log `log`"), "{message}");
        let elsewhere = "off_percent = 20.0\nstart = { kind = \"at\", q = [0.0], dq = [0.0] }";
        let message = refused(folder.path(), &study(method, CONTROLLER).replace("off_percent = 20.0", elsewhere));
        assert!(message.contains("cannot be simulated") && message.contains("start positions"), "{message}");
        let late = "reference = { file = \"trajectory.csv\", start_s = 2.0 }";
        let message =
            refused(folder.path(), &study(method, CONTROLLER).replace("reference = \"trajectory.csv\"", late));
        assert!(message.contains("has not begun or is over") && message.contains("start_s"), "{message}");
        let message =
            refused(folder.path(), &study(method, &CONTROLLER.replace("kp = [1500.0, 250.0]", "kp = [1.0, 2.0, 3.0]")));
        assert!(message.contains("[controller]") && message.contains("kp"), "{message}");
    }
}
