//! Logs from a person: mistakes are reported before the robot is evaluated, a corrected file is read again, and all
//! formats of the motion are written.

use super::simulated_arm::{Simulated, described, reference, settings, task};
use dynident_iteration::robot::{Envelope, FolderForm, FolderRobot, FolderSettings};
use dynident_iteration::{
    Iteration, IterationStatus, IterationStore, Robot, RobotRun, RobotStatus, RunRequest, SafetySettings, iterate,
};
use dynident_simulation::controllers::{ControllerModel, JointPdSettings};
use dynident_simulation::{ControllerSettings, Record};
use std::path::Path;

fn pd() -> ControllerSettings {
    ControllerSettings::JointPd(JointPdSettings { kp: 1200.0.into(), kd: 120.0.into() })
}

fn prior() -> ControllerModel {
    let robot = described();
    ControllerModel::from_parameters(robot.model(), robot.terms(), robot.nominal()).unwrap()
}

fn recorded() -> Record {
    let (controller, model, reference) = (settings().first.unwrap(), prior(), reference());
    let request = RunRequest { model: Some(&model), ..RunRequest::new(1, &reference, &controller) };
    Simulated::default().robot().run(&request).unwrap().record
}

fn envelope() -> Envelope {
    Envelope {
        lower: vec![None; 2],
        upper: vec![None; 2],
        speed: vec![Some(10.0); 2],
        torque: vec![Some(200.0); 2],
        tracking_error: vec![Some(0.3); 2],
        workspace: None,
        speed_span_s: 0.01,
    }
}

fn waits_for(run: &RobotRun, words: &[&str]) {
    let RobotStatus::Waiting { reason, .. } = &run.status else { panic!("{words:?}: {}", run.status) };
    assert!(words.iter().all(|word| reason.contains(word)), "{words:?}: {reason}");
}

/// Mistakes of units, signs, columns and clocks are reported with their fix before the envelope is checked; harmless
/// changes are applied and noted.
#[test]
fn mistakes_of_a_log_are_named_before_the_envelope() {
    let folder = tempfile::tempdir().unwrap();
    let mut robot = FolderRobot::new(FolderSettings::new(folder.path()), task().robot.joint_names()).unwrap();
    robot = robot.with_prior(Some(prior()));
    let (reference, controller, envelope) = (reference(), pd(), envelope());
    let request = RunRequest { envelope: Some(&envelope), ..RunRequest::new(1, &reference, &controller) };
    waits_for(&robot.run(&request).unwrap(), &["save the log here"]);
    let log = robot.run_folder(1).join("log.csv");
    let right = recorded();
    let mut taken = |change: &dyn Fn(&mut Record)| {
        let mut record = right.clone();
        change(&mut record);
        std::fs::write(&log, record.csv()).unwrap();
        robot.run(&request).unwrap()
    };
    let scale = |values: &mut Vec<f64>, factor: f64| values.iter_mut().for_each(|value| *value *= factor);
    let run = taken(&|record| scale(&mut record.q, 57.295_78));
    waits_for(&run, &["log.csv: ", "joint1, joint2", "(degrees): write radians", "need not move again"]);
    waits_for(&taken(&|record| scale(&mut record.times_s, 1e3)), &["milliseconds: multiply column t_s by 1e-3"]);
    waits_for(&taken(&|record| scale(&mut record.tau, 1e3)), &["mNm, or currents in mA", "write Nm"]);
    waits_for(&taken(&|record| scale(&mut record.q, -1.0)), &["joint1, joint2 have the opposite sign"]);
    let run = taken(&|record| record.q.rotate_left(record.samples));
    waits_for(&run, &["that of joint1 contains the motion of joint2"]);

    // Unix time stamps; a recorder that was started 0.7 s early.
    let run = taken(&|record| record.times_s.iter_mut().for_each(|time| *time += 1_700_000_000.25));
    assert!(run.status.is_done() && run.record.q == right.q, "{}", run.status);
    assert!(run.ending(&reference, 5.0).contains("offset was removed"), "{}", run.ending(&reference, 5.0));
    let run = taken(&|record| {
        let rows = (0.7 * right.rate_hz) as usize;
        let rest = (0..rows).map(|k| k as f64 / right.rate_hz);
        record.times_s = rest.chain(right.times_s.iter().map(|time| time + 0.7)).collect();
        let held = |values: &[f64]| -> Vec<f64> {
            let of_joint =
                |own: &[f64]| core::iter::repeat_n(own[0], rows).chain(own.iter().copied()).collect::<Vec<_>>();
            values.chunks_exact(right.samples).flat_map(of_joint).collect()
        };
        (record.q, record.tau) = (held(&right.q), held(&right.tau));
        record.samples += rows;
    });
    assert!(run.status.is_done() && run.record.times_s[0].abs() < 0.1, "{}", run.status);
    assert!(run.ending(&reference, 5.0).contains("s before the motion; these rows were removed"));

    // A robot that leaves its envelope is still reported, and a correct log is not changed.
    let run = taken(&|record| record.q[100] += 0.5);
    assert!(matches!(run.status, RobotStatus::LeftEnvelope { .. }), "{}", run.status);
    let run = taken(&|_| {});
    assert!(run.status.is_done() && run.record == right && run.note.is_none(), "{}", run.status);
}

#[test]
fn a_corrected_log_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let exchange = folder.path().join("exchange");
    let mut own = settings();
    own.safety = SafetySettings { outside: true, envelope: Some(envelope()), ..SafetySettings::default() };
    let iteration = Iteration::new(task(), own).unwrap();
    let calls = |out: &Path| {
        let store = IterationStore::open(out, "test", true).unwrap();
        let mut robot = FolderRobot::new(FolderSettings::new(&exchange), task().robot.joint_names()).unwrap();
        let outcome = iterate(&iteration, &mut [&mut robot], Some(&store), &mut |_, _| {}).unwrap();
        let IterationStatus::Waiting { reason } = outcome.status else { panic!("{}", outcome.status) };
        (outcome.runs, reason)
    };
    let (runs, reason) = calls(folder.path());
    assert!(runs.is_empty() && reason.contains("save the log here"), "{reason}");
    let right = recorded();
    // No unit explains this mistake: a wrong zero of a joint.
    let mut wrong = right.clone();
    wrong.q[..right.samples].iter_mut().for_each(|q| *q += 0.5);
    let log = exchange.join("run_1/log.csv");
    std::fs::write(&log, wrong.csv()).unwrap();
    let (runs, reason) = calls(folder.path());
    assert!(runs.len() == 1 && !runs[0].accepted && reason.contains("correct the file"), "{reason}");
    // Unchanged file: the run is not repeated, and the next one waits.
    let (runs, reason) = calls(folder.path());
    assert!(runs.len() == 1 && !runs[0].accepted && reason.contains("run_2"), "{reason}");
    std::fs::write(&log, right.csv()).unwrap();
    let (runs, reason) = calls(folder.path());
    assert!(runs.len() == 1 && runs[0].accepted && reason.contains("run_2"), "{:?} {reason}", runs[0].reason);
    assert_eq!(std::fs::read_to_string(folder.path().join("runs/run_1/log.csv")).unwrap(), right.csv());
    // A missing or incomplete file is not a correction.
    std::fs::write(&log, "t_s,q1").unwrap();
    assert!(calls(folder.path()).0[0].accepted);
    std::fs::remove_file(&log).unwrap();
    assert!(calls(folder.path()).0[0].accepted);
}

/// All formats, with the names of `design`, can be read back.
#[test]
fn every_form_of_a_motion_is_in_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let forms = vec![FolderForm::Ros2, FolderForm::Waypoints, FolderForm::Torque, FolderForm::Current];
    let torque_constants = Some(vec![50.0, 25.0].into());
    let settings = FolderSettings { forms, torque_constants, ..FolderSettings::new(folder.path()) };
    let joints = task().robot.joint_names();
    let mut robot = FolderRobot::new(settings.clone(), joints.clone()).unwrap();
    let (reference, controller, model) = (reference(), pd(), prior());
    let request = RunRequest { model: Some(&model), ..RunRequest::new(1, &reference, &controller) };
    robot.run(&request).unwrap();
    let text = |name: &str| std::fs::read_to_string(robot.run_folder(1).join(name)).unwrap();
    assert!(text("trajectory.ros2.yaml").contains("joint_names"));
    assert_eq!(text("waypoints.csv").lines().count(), reference.samples() + 1);
    let row = |name: &str, line: usize| -> Vec<f64> {
        text(name).lines().nth(line).unwrap().split(',').map(|field| field.parse().unwrap()).collect()
    };
    let (table, torque, current) = (row("trajectory.csv", 500), row("torque.csv", 500), row("current.csv", 500));
    assert_eq!((&torque[1..], torque[0]), (&table[7..], table[0]));
    assert_eq!(current, [table[0], table[7] / 50.0, table[8] / 25.0]);
    assert!(text("torque.csv").starts_with("t_s,tau1,tau2\n") && text("current.csv").starts_with("t_s,i1,i2\n"));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let own = folder.path().join("own");
        std::fs::write(&own, "").unwrap();
        for name in ["trajectory.csv", "controller.json", "torque.csv"] {
            assert_eq!(mode(&robot.run_folder(1).join(name)), mode(&own), "{name}");
        }
    }
    // A log with currents is converted with the same constants.
    let right = recorded();
    let mut currents = right.clone();
    for (own, constant) in currents.tau.chunks_exact_mut(right.samples).zip([50.0, 25.0]) {
        for value in own {
            *value /= constant;
        }
    }
    std::fs::write(robot.run_folder(1).join("log.csv"), currents.csv().replace("tau", "i")).unwrap();
    let run = robot.run(&request).unwrap();
    assert!(run.status.is_done() && run.record.tau.iter().zip(&right.tau).all(|(a, b)| (a - b).abs() < 1e-9));
    // A format without its settings is rejected before anything is written.
    let refused = |settings: FolderSettings| FolderRobot::new(settings, joints.clone()).unwrap_err().to_string();
    let message = refused(FolderSettings { torque_constants: None, ..settings.clone() });
    assert!(message.contains("torque_constants"), "{message}");
    let message = refused(FolderSettings { forms: vec![FolderForm::Urscript], ..settings });
    assert!(message.contains("six joints"), "{message}");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_no_log() {
    let folder = tempfile::tempdir().unwrap();
    let mut robot = FolderRobot::new(FolderSettings::new(folder.path()), task().robot.joint_names()).unwrap();
    let (reference, controller) = (reference(), pd());
    let request = RunRequest::new(1, &reference, &controller);
    robot.run(&request).unwrap();
    let log = robot.run_folder(1).join("log.csv");
    assert!(std::process::Command::new("mkfifo").arg(&log).status().unwrap().success());
    let status = robot.run(&request).unwrap().status;
    assert!(matches!(status, RobotStatus::Failed { .. }) && status.to_string().contains("a pipe"), "{status}");
}
