//! The lag of torque behind motion: estimated with valid error bars.
use crate::common::{Job, Motion, Random, Truth, format, header, repository};
use dynident::dynamics::Workspace;
use dynident::identification::examination::LagKind;
use std::fmt::Write;
use std::path::Path;

/// Writes a log with torque delayed by `lags_s[j]` at joint j, with AR(1) noise of standard deviation `sigma` and lag-1
/// correlation 0.9.
fn late_log(path: &Path, truth: &Truth, motion: &Motion, clock: (f64, f64), lags_s: &[f64], noise: (f64, &mut Random)) {
    let mut workspace = Workspace::new(&truth.model);
    let torque = |joint: usize, t: f64| {
        let [q, dq, ddq] = motion.at(t);
        truth.torque(&mut workspace, &q, &dq, &ddq)[joint]
    };
    write_rows(path, |t| motion.at(t)[0].clone(), torque, clock, lags_s, noise);
}

/// Writes the positions at each sample and the torque of joint j at a time that is `lags_s[j]` earlier, with the noise
/// of [`late_log`].
fn write_rows(
    path: &Path,
    mut position: impl FnMut(f64) -> Vec<f64>,
    mut torque: impl FnMut(usize, f64) -> f64,
    clock: (f64, f64),
    lags_s: &[f64],
    (sigma, random): (f64, &mut Random),
) {
    let (mut text, mut error) = (format!("{}\n", header(lags_s.len())), vec![0.0; lags_s.len()]);
    for k in 0..(clock.0 * clock.1) as usize {
        let t = k as f64 / clock.0;
        write!(text, "{t}").unwrap();
        for q in position(t) {
            write!(text, ",{q}").unwrap();
        }
        for (joint, lag) in lags_s.iter().enumerate() {
            let tau = torque(joint, t - lag);
            error[joint] = 0.9 * error[joint] + (1.0 - 0.81_f64).sqrt() * sigma * random.normal();
            write!(text, ",{}", tau + error[joint]).unwrap();
        }
        text.push('\n');
    }
    std::fs::write(path, text).unwrap();
}

/// A motion whose joints rest at each reversal: dry friction holds them while the controller builds up torque in the
/// new direction.
struct Sticking {
    motion: Motion,
    /// For each joint the times of its reversals, without the rests, s.
    reversals_s: Vec<Vec<f64>>,
    rest_s: f64,
}

impl Sticking {
    fn new(motion: Motion, dof: usize, seconds: f64, rest_s: f64) -> Self {
        let reversals = |joint: usize| {
            let speed = |t: f64| motion.at(t)[1][joint];
            let steps = (seconds * 1000.0) as usize;
            let turns = (0..steps).map(|k| k as f64 * 1e-3).filter(|t| speed(*t) * speed(t + 1e-3) <= 0.0);
            turns.map(|t| t + 1e-3 * speed(t) / (speed(t) - speed(t + 1e-3))).collect()
        };
        Self { reversals_s: (0..dof).map(reversals).collect(), motion, rest_s }
    }

    /// Position, velocity and acceleration of every joint, and the sign of its dry friction.
    fn at(&self, t: f64) -> ([Vec<f64>; 3], Vec<f64>) {
        let dof = self.reversals_s.len();
        let (mut state, mut signs) = (core::array::from_fn(|_| vec![0.0; dof]), vec![0.0; dof]);
        for joint in 0..dof {
            let mut own = t;
            let mut is_at_rest = false;
            for &reversal in self.reversals_s[joint].iter().take_while(|reversal| t > **reversal) {
                if own <= reversal {
                    break;
                }
                is_at_rest = own - self.rest_s <= reversal;
                own = (own - self.rest_s).max(reversal);
            }
            let [q, dq, ddq] = self.motion.at(own).map(|values| values[joint]);
            let moving = if is_at_rest { 0.0 } else { 1.0 };
            (state[0][joint], state[1][joint], state[2][joint]) = (q, moving * dq, moving * ddq);
            // At rest the friction already balances the torque in the new direction.
            signs[joint] = if is_at_rest { ddq.signum() } else { dq.signum() };
        }
        (state, signs)
    }
}

fn study(robot: &str, dof: usize, more: &str) -> String {
    format!("robot.file = {robot:?}\ndrive.friction = \"stated\"\n{more}\n{}", format(dof))
}

fn stating(study: &str, lag_s: Option<f64>) -> String {
    let key = |lag_s| format!("[motion]\ntorque_lag_s = {lag_s:?}");
    lag_s.map_or_else(|| study.to_owned(), |lag_s| study.replace("[motion]", &key(lag_s)))
}

#[test]
fn without_noise_the_lag_is_exact_though_the_model_absorbed_it() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("robots/ur10.urdf");
    let truth = Truth::near(&description, 0.2, true);
    // Far below a sample (2.5 ms), between samples, negative, zero, and many samples.
    let lags = [0.4e-3, 6.1e-3, -3.3e-3, 0.0, 31.7e-3, 8.0e-3];
    let noise = (0.0, &mut Random(1));
    late_log(&folder.path().join("log.csv"), &truth, &Motion::new(6, 1), (400.0, 12.0), &lags, noise);
    for filter in ["enabled = false", "factor = 4"] {
        let more = format!(
            "drive.drive_inertia = true\nlog = [{{ file = \"log.csv\" }}]\nparallel_filter = {{ {filter} }}\nestimator.physical = false"
        );
        let job = Job::new(folder.path(), &study(&description.display().to_string(), 6, &more));
        let result = job.identify().result;
        for (joint, lag) in result.joints.iter().zip(lags) {
            let found = joint.torque_lag.unwrap();
            // Torque between samples from quintics: the Coulomb step (0.02 rad/s wide, passed in about 10 ms) is
            // sampled every 2.5 ms, which gives errors of 0.01 samples.
            assert!((found.lag_s - lag).abs() < 2.5e-5, "{}: {found:?} for {lag}, {filter}", joint.name);
        }
        assert_eq!(result.logs[0].torque_lag_s.len(), 6);
        assert!(result.logs[0].model_findings.iter().any(|f| f.message.contains("31.7")), "{filter}");
    }
}

#[test]
fn intervals_hold_the_lag() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&description, 0.3, false);
    let more = "log = [{ file = \"log.csv\" }]\nparallel_filter.factor = 2\nestimator.physical = false";
    let job = Job::new(folder.path(), &study(&description.display().to_string(), 2, more));
    let mut random = Random(3);
    let (mut inside, mut intervals) = (0_usize, 0_usize);
    for run in 0..60 {
        let lags = [5.0e-3 * random.next(), 12.0e-3 + 5.0e-3 * random.next()];
        let noise = (0.5, &mut random);
        late_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 10 + run), (100.0, 30.0), &lags, noise);
        for (joint, lag) in job.identify().result.joints.iter().zip(lags) {
            let found = joint.torque_lag.unwrap();
            inside += usize::from((found.lag_s - lag).abs() <= found.half_width_95_s);
            intervals += 1;
        }
    }
    // 120 intervals give 95 % within 2 %: three of these below; the jackknife is slightly conservative.
    let share = inside as f64 / intervals as f64;
    assert!((0.89..=1.0).contains(&share), "{share}");
}

#[test]
fn a_log_that_stands_still_tells_no_lag() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let mut text = format!("{}\n", header(2));
    let mut random = Random(5);
    for k in 0..800 {
        writeln!(text, "{},0.3,-0.2,{},{}", f64::from(k) * 0.01, 3.0 + random.normal(), 1.0 + random.normal()).unwrap();
    }
    std::fs::write(folder.path().join("log.csv"), text).unwrap();
    let more = "log = [{ file = \"log.csv\" }]\nparallel_filter.enabled = false";
    let job = Job::new(folder.path(), &study(&description.display().to_string(), 2, more));
    let result = job.identify().result;
    assert!(result.joints.iter().all(|joint| joint.torque_lag.is_none()));
    assert_eq!(result.logs[0].torque_lag_s, [None, None]);
}

/// A recorder lag of 0 to 8 ms at every joint: coverage of the parameters' 95 % intervals, and their errors in standard
/// deviations.
fn coverage_with_a_lag(runs: u64, stated: Option<f64>) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&description, 0.3, false);
    let more = "log = [{ file = \"log.csv\" }]\nparallel_filter.factor = 2\nestimator.physical = false";
    let text = stating(&study(&description.display().to_string(), 2, more), stated);
    let job = Job::new(folder.path(), &text);
    let expected = truth.base_values(&job.robot());
    let mut random = Random(8);
    let (mut inside, mut intervals, mut squares) = (0_usize, 0_usize, 0.0);
    for run in 0..runs {
        let lag_s = 8.0e-3 * run as f64 / (runs - 1) as f64;
        let noise = (0.5, &mut random);
        late_log(&folder.path().join("log.csv"), &truth, &Motion::new(2, 100 + run), (200.0, 30.0), &[lag_s; 2], noise);
        let result = job.identify().result;
        for (found, truth) in result.base_parameters.iter().zip(&expected) {
            let error = found.value - truth;
            inside += usize::from(error.abs() <= found.half_width_95);
            squares += (error / found.std).powi(2);
            intervals += 1;
        }
    }
    (inside as f64 / intervals as f64, (squares / intervals as f64).sqrt())
}

#[test]
fn parameters_are_right_whatever_the_lag() {
    let (inside, off) = coverage_with_a_lag(24, None);
    // 240 intervals of about ten parameters with correlated errors per run: 95 % within 3 %, two of these below. The
    // jackknife is slightly conservative.
    assert!(inside >= 0.89 && (0.6..=1.3).contains(&off), "{inside}, {off}");
    // The same as logged: the effect of an uncompensated lag.
    let (inside, off) = coverage_with_a_lag(8, Some(0.0));
    assert!(inside < 0.85 && off > 1.5, "{inside}, {off}");
}

#[test]
fn a_lag_is_taken_off_found_or_stated_and_the_test_does_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("robots/ur10.urdf");
    let truth = Truth::near(&description, 0.2, true);
    let mut random = Random(4);
    for (name, seed) in [("train.csv", 1), ("test.csv", 2)] {
        let noise = (0.05, &mut random);
        late_log(&folder.path().join(name), &truth, &Motion::new(6, seed), (250.0, 20.0), &[5.0e-3; 6], noise);
    }
    let logs =
        "drive.drive_inertia = true\nlog = [{ file = \"train.csv\" }, { file = \"test.csv\", role = \"validate\" }]";
    let held_out = |stated: Option<f64>| {
        let text = stating(&study(&description.display().to_string(), 6, logs), stated);
        let job = Job::new(folder.path(), &text);
        let outcome = job.identify();
        let path = folder.path().join("result.json");
        std::fs::write(&path, serde_json::to_string(&outcome.result).unwrap()).unwrap();
        let again = dynident::validate(&path, &job.study, &job.path, &Job::options(1)).unwrap();
        let percent = outcome.result.validation[0].model.relative_error_percent.unwrap();
        // `validate` compensates the stored lag: the same figure within rounding of the file.
        assert!((again.validation[0].model.relative_error_percent.unwrap() - percent).abs() < 1e-6 * percent);
        (outcome.result, percent)
    };
    let (found, with_lag_found) = held_out(None);
    assert_eq!(found.method.torque_lag.kind, LagKind::Common);
    for lag_s in &found.method.torque_lag.lag_s {
        // Its error bar is about 0.01 ms; the tolerance of 0.1 ms is far below a sample (4 ms).
        assert!((lag_s - 5.0e-3).abs() < 1.0e-4, "{lag_s}");
    }
    let common = found.method.torque_lag.common.unwrap();
    assert!((common.lag_s - 5.0e-3).abs() < 1.0e-4 && common.taken_off_s > 4.9e-3, "{common:?}");
    let (stated, with_lag_stated) = held_out(Some(0.005));
    assert_eq!((stated.method.torque_lag.kind, stated.method.torque_lag.lag_s.len()), (LagKind::Stated, 6));
    let (as_logged, with_lag_left) = held_out(Some(0.0));
    assert!(as_logged.joints.iter().any(|joint| joint.torque_lag.is_some_and(|lag| lag.matters)));
    // Estimated and stated lag are equivalent; an uncompensated lag is not.
    assert!((with_lag_found / with_lag_stated - 1.0).abs() < 0.02, "{with_lag_found} {with_lag_stated}");
    assert!(with_lag_left > 1.5 * with_lag_found, "{with_lag_left} {with_lag_found}");
}

/// Lags in their 95 % intervals, and base parameters in theirs, for robots that stick 20 ms at each reversal.
fn coverage_with_sticking_joints(lag_s: f64, runs: u64) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let description = repository("examples/robots/paper_2r.toml");
    let truth = Truth::near(&description, 0.3, false);
    let more = "drive.coulomb = \"sign\"\nlog = [{ file = \"log.csv\" }]\nestimator.physical = false";
    // With the default filter of positions.
    let text = study(&description.display().to_string(), 2, more)
        .replace("differentiator = { method = \"central-differences\", order = 8 }", "");
    let job = Job::new(folder.path(), &text);
    let expected = truth.base_values(&job.robot());
    let (mut random, mut of_encoder) = (Random(21), Random(22));
    let [mut lags, mut inside, mut intervals] = [0_usize; 3];
    for run in 0..runs {
        let motion = Sticking::new(Motion::new(2, 300 + run), 2, 30.0, 20.0e-3);
        let mut workspace = Workspace::new(&truth.model);
        let torque = |joint: usize, t: f64| {
            let ([q, dq, ddq], signs) = motion.at(t);
            let smooth = truth.torque(&mut workspace, &q, &dq, &ddq)[joint];
            let [_, _, coulomb, _] = truth.drive[joint];
            smooth + coulomb * (signs[joint] - (dq[joint] / truth.coulomb_width(joint)).tanh())
        };
        let noise = (0.1, &mut random);
        let path = folder.path().join("log.csv");
        let encoder = |t: f64| motion.at(t).0[0].iter().map(|q| q + 2.0e-5 * of_encoder.normal()).collect();
        write_rows(&path, encoder, torque, (200.0, 30.0), &[lag_s; 2], noise);
        let result = job.identify().result;
        let common = result.method.torque_lag.common.unwrap();
        lags += usize::from((common.lag_s - lag_s).abs() <= common.half_width_95_s);
        for (found, truth) in result.base_parameters.iter().zip(&expected) {
            inside += usize::from((found.value - truth).abs() <= found.half_width_95);
            intervals += 1;
        }
    }
    (lags as f64 / runs as f64, inside as f64 / intervals as f64)
}

#[test]
fn joints_that_stick_at_reversals_do_not_look_like_a_lag() {
    for lag_s in [0.0, 4.0e-3] {
        let (lags, inside) = coverage_with_sticking_joints(lag_s, 20);
        // 20 intervals of 95 %: fewer than 17 in 2 of 100 tests. The model still lacks what the joints do at rest, so
        // the share of the parameters is below 95 %; without the times of reversal it is 0.74, and 0.80 for the lags.
        assert!(lags >= 0.85 && inside >= 0.80, "{lag_s}: {lags}, {inside}");
    }
}
