//! Estimators that read the logs again, and their messages for unsuitable logs.
use crate::common::{Job, Motion, Random, Truth, header, repository, write_log};
use dynident::{Error, IdentificationOutcome, identify};
use std::fmt::Write;
use std::path::Path;

const CLOCK: (f64, f64) = (250.0, 16.0);
/// The lowest frequency of the motion is 0.13 Hz.
const PERIOD_S: f64 = 1.0 / 0.13;

fn arm() -> std::path::PathBuf {
    repository("robots/planar2r.urdf")
}

/// The arm without Coulomb friction, whose step is not small compared with the noise here.
fn truth() -> Truth {
    let mut truth = Truth::near(&arm(), 0.1, false);
    truth.drive.iter_mut().for_each(|drive| drive[2] = 0.0);
    truth
}

fn study(method: &str, further: &str) -> String {
    format!(
        r#"
        robot.file = {:?}
        drive.coulomb = "none"
        {further}
        [format]
        time = {{ column = "t" }}
        position = {{ columns = "q{{1..2}}" }}
        torque = {{ columns = "tau{{1..2}}" }}
        [[log]]
        file = "log.csv"
        [estimator]
        method = "{method}"
        "#,
        arm().display().to_string(),
    )
}

fn run(folder: &Path, text: &str) -> Result<IdentificationOutcome, Error> {
    let job = Job::new(folder, text);
    identify(&job.study, &job.path, &Job::options(1))
}

/// Root mean square error in units of `bars`.
fn score(found: &IdentificationOutcome, truth: &[f64], bars: &[f64]) -> f64 {
    let squares = (0..truth.len()).map(|i| ((found.estimate.values[i] - truth[i]) / bars[i]).powi(2));
    (squares.sum::<f64>() / truth.len() as f64).sqrt()
}

#[test]
fn rows_count_by_the_noise_around_them() {
    let (folder, truth, mut random, mut row) = (tempfile::tempdir().unwrap(), truth(), Random(3), 0);
    // The second half has fifty times the noise.
    write_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 1), CLOCK, &header(2), |q, tau| {
        row += 1;
        let sigma = if row < 2000 { 0.02 } else { 1.0 };
        q.iter().copied().chain(tau.iter().map(|t| t + sigma * random.normal())).collect()
    });
    let further =
        "parallel_filter.enabled = false\nmotion.differentiator = { method = \"central-differences\", order = 8 }";
    let plain = run(folder.path(), &study("weighted", further)).unwrap();
    let text = study("noise-weighted", further) + "noise_levels = { window_rows = 41, pooled_share = 1e-4 }";
    let job = Job::new(folder.path(), &text);
    let found = job.identify();
    let values = truth.base_values(&job.robot());
    let levels = found.result.noise_levels.as_ref().unwrap();
    assert!(levels.iter().all(|[least, most]| *least < 0.1 && *most > 1.0), "{levels:?}");
    assert!(plain.result.noise_levels.is_none());
    // Half of the rows with noise 0.02 in place of all rows with 0.7 rms: 0.02 · √2 / 0.7 = 4 % of the error; both are
    // random.
    let (reweighted, weighted) =
        (score(&found, &values, &plain.estimate.std), score(&plain, &values, &plain.estimate.std));
    assert!(reweighted < 0.2 * weighted, "{reweighted} and {weighted}");
    // Its error bars are valid: about nine squares.
    assert!(score(&found, &values, &found.estimate.std) < 2.0);
}

/// Positions with noise of 2 mrad: 0.03 rad/s² at the highest frequency of the motion, 0.65 Hz, and much more behind a
/// filter that passes the motion.
fn write_noisy(folder: &Path, name: &str, truth: &Truth, seed: u64, seconds: f64) {
    let mut random = Random(seed);
    write_log(&folder.join(name), truth, &Motion::new(2, seed), (250.0, seconds), &header(2), |q, tau| {
        let q: Vec<f64> = q.iter().map(|q| q + 2e-3 * random.normal()).collect();
        q.into_iter().chain(tau.iter().map(|t| t + 0.05 * random.normal())).collect()
    });
}

#[test]
fn motion_and_parameters_together_find_the_truth_within_their_bars() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    write_noisy(folder.path(), "log.csv", &truth, 3, 16.0);
    write_noisy(folder.path(), "other.csv", &truth, 5, 12.0);
    let two = |method: &str| study(method, "").replace("[estimator]", "[[log]]\nfile = \"other.csv\"\n[estimator]");
    let plain = run(folder.path(), &two("weighted")).unwrap();
    assert!(plain.result.series.is_none());
    let job = Job::new(folder.path(), &(two("simultaneous") + &format!("periods.period_s = {PERIOD_S}")));
    let found = job.identify();
    let values = truth.base_values(&job.robot());
    let series = found.result.series.as_ref().unwrap();
    assert_eq!((series.len(), series[0].torque_autoregression.len()), (2, 2));
    for log in series {
        // The motion has five harmonics; passing higher frequencies increases variance slightly, without bias.
        assert!((5..=12).contains(&log.harmonics), "{log:?}");
        assert_eq!(log.samples_of_row, (250.0 * PERIOD_S / (60.0 * log.harmonics as f64)) as usize);
        // Means of n samples have noise smaller by √n.
        let std = 2e-3 / (log.samples_of_row as f64).sqrt();
        assert!(log.position_std.iter().all(|found| (found / std - 1.0).abs() < 0.2), "{log:?} {std}");
    }
    let bars = &found.estimate.std;
    let together = score(&found, &values, bars);
    // Nine squares with mean one: below 1.8 by four standard deviations.
    assert!(together < 1.8, "{together}");
}

/// Without a period the motion is a spline; both pieces of a log with a gap are used.
#[test]
fn motion_and_parameters_of_any_log_find_the_truth() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    // A tenth of the noise of the other tests, because with more noise the spline's band is wider than that of the
    // motion.
    let (path, mut random) = (folder.path().join("log.csv"), Random(3));
    write_log(&path, &truth, &Motion::new(2, 3), (250.0, 16.0), &header(2), |q, tau| {
        let q: Vec<f64> = q.iter().map(|q| q + 2e-4 * random.normal()).collect();
        q.into_iter().chain(tau.iter().map(|t| t + 0.05 * random.normal())).collect()
    });
    let log = std::fs::read_to_string(folder.path().join("log.csv")).unwrap();
    let lines = log.lines().enumerate().filter(|(row, _)| !(2000..2200).contains(row)).map(|(_, line)| line);
    std::fs::write(folder.path().join("log.csv"), lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let job = Job::new(folder.path(), &study("simultaneous", ""));
    let found = job.identify();
    let values = truth.base_values(&job.robot());
    let spline = found.result.spline_motion.as_ref().unwrap();
    assert!(found.result.series.is_none() && spline.cost <= spline.cost_at_start);
    assert_eq!(spline.logs.len(), 1);
    for joint in &spline.logs[0].joints {
        // σ from 3800 samples has an uncertainty of 1.2 %, and the spline's share is estimated: four of these.
        assert!((joint.position_std / 2e-4 - 1.0).abs() < 0.05, "{joint:?}");
    }
    // Compared with filtered least squares, in its error bars, because the same noise affects both.
    let plain = Job::new(folder.path(), &study("weighted", "")).identify();
    let (together, alone) = (score(&found, &values, &plain.estimate.std), score(&plain, &values, &plain.estimate.std));
    assert!(together < 1.5 * alone, "{together} and {alone}");
}

/// `maximum-likelihood` is another name of the spline; a period in its study is not used.
#[test]
fn maximum_likelihood_is_the_spline() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    write_noisy(folder.path(), "log.csv", &truth, 3, 16.0);
    let spline = run(folder.path(), &study("simultaneous", "")).unwrap();
    let text = study("maximum-likelihood", "") + &format!("periods.period_s = {PERIOD_S}");
    let found = run(folder.path(), &text).unwrap();
    assert_eq!(found.result.method.estimator, "maximum-likelihood");
    assert!(found.result.periodic.is_none() && found.result.spline_motion.is_some());
    assert_eq!((found.estimate.values, found.estimate.std), (spline.estimate.values, spline.estimate.std));
}

#[test]
fn logs_without_a_series_are_refused_with_the_fix() {
    let (folder, truth) = (tempfile::tempdir().unwrap(), truth());
    write_noisy(folder.path(), "log.csv", &truth, 3, 16.0);
    let text = study("simultaneous", "");
    let message = |text: &str| run(folder.path(), text).unwrap_err().to_string();
    let unknown = message(&(text.clone() + "periods.harmonics = 5"));
    assert!(unknown.contains("reference"), "{unknown}");
    let another = message(&(text.clone() + "periods = { period_s = 5.0, harmonics = 5 }"));
    assert!(another.contains("fix period_s") && another.contains("joint1"), "{another}");
    let short = message(&(text.clone() + "periods = { period_s = 7.69, skip_s = 12.0 }"));
    assert!(short.contains("less than one period"), "{short}");
    let none = Job::new_error(folder.path(), &(text.clone() + "periods.harmonics = 0"));
    assert!(none.contains("[estimator.periods]") && none.contains("harmonics = 0"), "{none}");
    let remembered = text
        .replace("drive.coulomb = \"none\"", "drive.laws = [{ law = \"maxwell-slip\", yield_displacements = [0.01] }]");
    let remembered = message(&(remembered + "periods.period_s = 7.69"));
    assert!(remembered.contains("the motion of one instant"), "{remembered}");
    let log = std::fs::read_to_string(folder.path().join("log.csv")).unwrap();
    let lines = log.lines().enumerate().filter(|(row, _)| !(2000..2200).contains(row)).map(|(_, line)| line);
    std::fs::write(folder.path().join("log.csv"), lines.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let gap = message(&(text + &format!("periods.period_s = {PERIOD_S}")));
    assert!(gap.contains("has a gap") && gap.contains("time_range_s"), "{gap}");
}

/// Studies of the new methods on a log from `write`; the simulated ones follow `reference.csv`.
fn with_each_new_method(
    folder: &Path,
    reference: &dyn Fn(f64) -> [[f64; 2]; 3],
    mut check: impl FnMut(&str, Result<IdentificationOutcome, Error>),
) {
    let mut table = "t_s,q1,q2,dq1,dq2,ddq1,ddq2".to_owned();
    for k in 0..=1000 {
        let t = f64::from(k) * 0.004;
        write!(table, "\n{t}").unwrap();
        reference(t).iter().flatten().for_each(|x| write!(table, ",{x}").unwrap());
    }
    std::fs::write(folder.join("reference.csv"), table + "\n").unwrap();
    for method in ["noise-weighted", "maximum-likelihood", "didim", "clie", "cloe"] {
        let further = "controller = { kind = \"joint-pd\", kp = [200.0, 60.0], kd = [40.0, 3.0] }\nsimulation.rate_hz = 1000.0\n\
                       motion.differentiator = { method = \"central-differences\", order = 2 }\nparallel_filter.enabled = false";
        let text = study(method, further)
            .replace("file = \"log.csv\"", "file = \"log.csv\"\nreference = \"reference.csv\"")
            + "periods.period_s = 1.0\nsimulated.max_iterations = 4";
        check(method, run(folder, &text));
    }
}

/// A log of the arm with a little torque noise for the weights.
fn write_motion(folder: &Path, rows: usize, motion: &dyn Fn(f64) -> [[f64; 2]; 3]) {
    let truth = truth();
    let mut workspace = dynident::dynamics::Workspace::new(&truth.model);
    let mut random = Random(4);
    let mut text = header(2);
    for k in 0..rows {
        let t = k as f64 * 0.004;
        let [q, dq, ddq] = motion(t);
        let tau = truth.torque(&mut workspace, &q, &dq, &ddq);
        let tau: Vec<f64> = tau.iter().map(|tau| tau + 0.05 * random.normal()).collect();
        write!(text, "\n{t},{},{},{},{}", q[0], q[1], tau[0], tau[1]).unwrap();
    }
    std::fs::write(folder.join("log.csv"), text + "\n").unwrap();
}

/// Two sines with a period of 1 s.
fn both(t: f64) -> [[f64; 2]; 3] {
    let w = core::f64::consts::TAU;
    let sine = |amplitude: f64, times: f64, phase: f64| {
        let (w, at) = (times * w, times * w * t + phase);
        [amplitude * at.sin(), amplitude * w * at.cos(), -amplitude * w * w * at.sin()]
    };
    let (a, b) = (sine(0.8, 1.0, 0.3), sine(0.6, 2.0, 1.0));
    core::array::from_fn(|order| [a[order], b[order]])
}

fn finite(found: &IdentificationOutcome) {
    let estimate = &found.estimate;
    for (name, values) in [("values", &estimate.values), ("std", &estimate.std), ("sigma", &estimate.joint_sigma)] {
        assert!(values.iter().all(|value| value.is_finite()), "{name}: {values:?}");
    }
    assert!(found.result.bodies.iter().all(|body| body.parameters.iter().all(|x| x.is_finite())));
}

#[test]
fn fewer_samples_than_parameters_is_a_verdict() {
    let folder = tempfile::tempdir().unwrap();
    write_motion(folder.path(), 5, &both);
    with_each_new_method(folder.path(), &both, |method, outcome| {
        let message = outcome.err().unwrap_or_else(|| panic!("{method} made a model of five samples")).to_string();
        let said = message.contains("rows for") || message.contains("no piece of 64 samples");
        assert!(said && (message.contains("joint") || message.contains("log")), "{method}: {message}");
    });
}

#[test]
fn a_joint_that_does_not_move_leaves_its_parameters_named() {
    let folder = tempfile::tempdir().unwrap();
    let still = |t: f64| both(t).map(|[first, _]| [first, 0.0]);
    let still = |t: f64| {
        let mut state = still(t);
        state[0][1] = 0.4;
        state
    };
    write_motion(folder.path(), 1000, &still);
    with_each_new_method(folder.path(), &still, |method, outcome| {
        let found = outcome.unwrap_or_else(|error| panic!("{method}: {error}"));
        finite(&found);
        if ["didim", "clie", "cloe"].contains(&method) {
            // The simulated joint yields slightly, so its parameters are determined, but poorly.
            return;
        }
        assert_eq!(found.result.method.status, "not-all-excited", "{method}");
        assert!(
            found.result.method.not_excited.iter().any(|name| name.contains("fv2")),
            "{method}: {:?}",
            found.result.method.not_excited
        );
    });
}

#[test]
fn a_robot_at_rest_tells_its_gravity_and_names_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let rest = |_: f64| [[0.3, 0.4], [0.0; 2], [0.0; 2]];
    write_motion(folder.path(), 1000, &rest);
    with_each_new_method(folder.path(), &rest, |method, outcome| {
        let found = outcome.unwrap_or_else(|error| panic!("{method}: {error}"));
        finite(&found);
        if ["didim", "clie", "cloe"].contains(&method) {
            // The simulated robot sags, unlike the log, so the estimate is not complete.
            assert_ne!(found.result.method.status, "complete", "{method}");
            return;
        }
        assert_eq!(found.result.method.status, "not-all-excited", "{method}");
        let held = &found.result.method.not_excited;
        for name in ["fv1", "fv2"] {
            assert!(held.iter().any(|other| other.contains(name)), "{method}: {held:?}");
        }
    });
}
