//! An iteration that is killed at any moment resumes with the same result, bit for bit.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
#![cfg(unix)]

use dynident_dynamics::ParametricModel;
use dynident_excitation::families::{SplicedLogisticSettings, Step, StepWiseLogistic};
use dynident_iteration::SimulatedRobot;
use dynident_iteration::{
    Iteration, IterationError, IterationOutcome, IterationSettings, IterationStore, IterationTask, iterate,
};
use dynident_model::InertialParameters;
use dynident_model::sample::{Random, planar_2r};
use dynident_simulation::controllers::{FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{ControllerSettings, Integrator, LoopSettings, Plant, Reference, SensorSettings};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const FOLDER: &str = "DYNIDENT_TEST_ITERATION";
const FINGERPRINT: &str = "test";
const RUNS: usize = 5;

/// The paper's arm with noise, on quick strokes: five runs of ten seconds.
fn outcome(folder: &Path) -> Result<IterationOutcome, IterationError> {
    let tip = InertialParameters([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0]);
    let arm = planar_2r(1.0, tip, tip);
    let steps = [1, 0].map(|joint| Step { joint, period_s: 5.0 });
    let family = StepWiseLogistic::new(&[0.0; 2], &steps, &SplicedLogisticSettings::default()).unwrap();
    let reference = Reference::of_family(&family, &[1.0, 8.0, 1.0, 8.0], 500.0, None).unwrap();
    let robot = ParametricModel::new(arm.clone(), Vec::new()).unwrap().with_nominal(vec![0.0; 20]).unwrap();
    let mut settings = IterationSettings {
        model_free: ControllerSettings::JointPd(JointPdSettings { kp: 200.0.into(), kd: 60.0.into() }),
        controller: ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(20.0, 10.0)),
        max_runs: RUNS,
        ..IterationSettings::default()
    };
    settings.settled.parameter_sigmas = 0.0;
    settings.settled.parameter_tolerance = 0.0;
    let iteration = Iteration::new(IterationTask::new(robot, reference)?, settings)?;
    let sensors = SensorSettings { record_rate_hz: Some(500.0), ..SensorSettings::birdy_standard(5) };
    let looped =
        LoopSettings { integrator: Integrator::Rk4 { steps_per_sample: 1 }, sensors, ..LoopSettings::default() };
    let mut robot = SimulatedRobot::new(Plant::new(&arm, &[], &[]).unwrap(), looped)?;
    let store = IterationStore::open(folder, FINGERPRINT, true)?;
    iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {})
}

/// The process that is killed: this program with only this test.
#[test]
#[ignore = "the child of the tests below"]
fn child() {
    let Ok(folder) = std::env::var(FOLDER) else { return };
    outcome(Path::new(&folder)).unwrap();
}

fn killed_at(moments: usize) {
    let whole = tempfile::tempdir().unwrap();
    let expected = outcome(whole.path()).unwrap();
    assert_eq!(expected.runs.len(), RUNS);
    let child = |folder: &Path| {
        Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "child", "--ignored"])
            .env(FOLDER, folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    };
    // Duration of an undisturbed child, so that kills occur at any time of it. The check does not depend on it.
    let timed = tempfile::tempdir().unwrap();
    let begun = Instant::now();
    assert!(child(timed.path()).wait().unwrap().success());
    let lasts = begun.elapsed();
    let mut random = Random::new(11);
    let (mut kills, mut found) = (0, [0; RUNS + 1]);
    while kills < moments {
        let folder = tempfile::tempdir().unwrap();
        loop {
            let mut running = child(folder.path());
            if kills < moments {
                std::thread::sleep(Duration::from_secs_f64(random.uniform(0.0, lasts.as_secs_f64())));
                // Killing a finished child is valid, too.
                running.kill().unwrap();
            }
            let killed = !running.wait().unwrap().success();
            kills += usize::from(killed);
            let store = IterationStore::open(folder.path(), FINGERPRINT, true).unwrap();
            let records = store.records().unwrap();
            // The stored runs are the begin of the expected result.
            assert_eq!(records[..], expected.runs[..records.len()]);
            found[records.len()] += 1;
            if !killed {
                break;
            }
        }
        assert_eq!(outcome(folder.path()).unwrap(), expected);
        for run in 1..=RUNS {
            for name in ["run.json", "log.csv"] {
                let [one, other] = [whole.path(), folder.path()]
                    .map(|folder| std::fs::read(folder.join(format!("runs/run_{run}/{name}"))).unwrap());
                assert!(one == other, "run {run}: {name} differs");
            }
        }
    }
    println!("{kills} kills; runs found whole afterwards: {found:?}");
}

#[test]
fn killed_at_some_moments_it_goes_on_to_the_same_result() {
    killed_at(dynident_testing::count(4, 50));
}

/// Runs are fitted together, also after a kill: the missing log of a good run is reported, and nothing is fitted
/// without it.
#[test]
fn a_log_that_is_gone_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let whole = outcome(folder.path()).unwrap();
    assert!(whole.runs[1..].iter().all(|run| run.pooled.is_some()));
    std::fs::remove_dir_all(folder.path().join(format!("runs/run_{RUNS}"))).unwrap();
    let log = folder.path().join("runs/run_2/log.csv");
    let kept = std::fs::read(&log).unwrap();
    std::fs::remove_file(&log).unwrap();
    let error = outcome(folder.path()).unwrap_err().to_string();
    assert!(error.contains("run_2") && error.contains("put the log back"), "{error}");
    std::fs::write(&log, kept).unwrap();
    assert_eq!(outcome(folder.path()).unwrap(), whole);
}

/// A file from outside may contain anything: values that do not fit the robot are rejected with the file's name, and
/// nothing is overwritten.
#[test]
fn runs_whose_numbers_do_not_fit_the_robot_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path()).unwrap();
    let path = folder.path().join("runs/run_2/run.json");
    let good = std::fs::read_to_string(&path).unwrap();
    let mut file: serde_json::Value = serde_json::from_str(&good).unwrap();
    file["outcome"] = "edited".into();
    std::fs::write(&path, file.to_string()).unwrap();
    let error = outcome(folder.path()).unwrap_err().to_string();
    assert!(error.contains("run_2") && error.contains("edited or damaged"), "{error}");
    // As in an earlier version, without a hash.
    file = serde_json::from_str(&good).unwrap();
    file.as_object_mut().unwrap().remove("content_sha256").unwrap();
    let numbers = [
        "/estimate/values",
        "/estimate/std",
        "/estimate/covariance",
        "/estimate/covariance/0",
        "/estimate/joint_sigma",
        "/pooled/values",
        "/pooled/covariance",
        "/evidence/joints",
        "/max_tracking_error_rad",
        "/controller/model/values",
    ];
    for key in numbers {
        let mut short = file.clone();
        short.pointer_mut(key).unwrap().as_array_mut().unwrap().pop();
        let text = short.to_string();
        std::fs::write(&path, &text).unwrap();
        let error = outcome(folder.path()).unwrap_err();
        assert!(matches!(error, IterationError::State { .. }), "{key}: {error}");
        assert!(error.to_string().contains("run_2") && error.to_string().contains("numbers in"), "{key}: {error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
    let mut beyond = file;
    beyond.pointer_mut("/estimate/fixed").unwrap().as_array_mut().unwrap().push(99.into());
    std::fs::write(&path, beyond.to_string()).unwrap();
    assert!(outcome(folder.path()).unwrap_err().to_string().contains("base parameter 99"));
    std::fs::write(&path, good).unwrap();
    outcome(folder.path()).unwrap();
}

#[test]
fn runs_of_another_iteration_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    outcome(folder.path()).unwrap();
    let error = IterationStore::open(folder.path(), "other", true).unwrap_err();
    assert!(matches!(error, IterationError::State { .. }), "{error}");
    let store = IterationStore::open(folder.path(), "other", false).unwrap();
    assert!(store.records().unwrap().is_empty());
    std::fs::create_dir(store.run_folder(1)).unwrap();
    std::fs::write(store.run_folder(1).join("run.json"), "{\"schema\":").unwrap();
    assert!(matches!(store.records(), Err(IterationError::State { .. })));
}
