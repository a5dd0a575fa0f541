//! Stops: requested, or because a sample leaves the envelope; in every mode, with a robot that answers and with one
//! that does not; and no process of a robot remains.

use super::robots::{client, joints, pd, process_robot, reference};
use dynident_dynamics::ParametricModel;
use dynident_iteration::robot::{
    Breach, Envelope, EnvelopeQuantity, FolderRobot, FolderSettings, ProcessLimits, ProcessMode, ProcessRobot,
    ProcessSettings, Stopping, WorkspaceSettings,
};
use dynident_iteration::{
    Iteration, IterationSettings, IterationStatus, IterationStore, IterationTask, NextMotion, Robot, RobotFault,
    RobotRun, RobotStatus, RunRecord, RunRequest, SafetySettings, SimulatedRobot, StopSignal, Supervisor,
    iterate_supervised,
};
use dynident_model::load_robot;
use dynident_simulation::{LoopSettings, Plant, Reference};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

const BOTH: [ProcessMode; 2] = [ProcessMode::Run, ProcessMode::Step];

fn urdf() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf")
}

/// The example program with a fault and a marker file in the folder.
fn command(fault: &str, folder: &Path) -> Vec<String> {
    let marker = folder.join("marker");
    let words = [&client(), &urdf(), Path::new("--fault"), Path::new(fault), Path::new("--marker"), &marker];
    words.iter().map(|word| word.to_str().unwrap().to_owned()).collect()
}

fn settings(mode: ProcessMode, command: Vec<String>) -> ProcessSettings {
    let limits = ProcessLimits { message_s: 60.0, stop_s: 60.0, bye_s: 0.2, ..ProcessLimits::default() };
    ProcessSettings { command, mode, limits, folder: None }
}

fn marked(folder: &Path) -> String {
    // Fail instead of waiting forever.
    for _ in 0..30_000 {
        match std::fs::read_to_string(folder.join("marker")) {
            Ok(word) => return word,
            Err(_) => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    panic!("the program never wrote its marker");
}

/// Whether a process with this id runs (zombies excluded).
fn runs(id: &str) -> bool {
    let state = Command::new("ps").args(["-o", "stat=", "-p", id]).output().unwrap();
    let state = String::from_utf8_lossy(&state.stdout).trim().to_owned();
    !state.is_empty() && !state.starts_with('Z')
}

fn stopped_at_the_mark(robot: &mut ProcessRobot, folder: &Path) -> RobotRun {
    let stop = StopSignal::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            marked(folder);
            stop.request();
        });
        let (reference, controller) = (reference(), pd());
        robot.run(&RunRequest { stop: Some(&stop), ..RunRequest::new(1, &reference, &controller) }).unwrap()
    })
}

/// The program is silent during a motion: the stop is the next message it gets, and the samples are kept.
#[test]
fn a_stop_reaches_the_robot_in_every_mode() {
    for mode in BOTH {
        let folder = tempfile::tempdir().unwrap();
        let mut robot = process_robot(settings(mode, command("wait", folder.path())), joints()).unwrap();
        let run = stopped_at_the_mark(&mut robot, folder.path());
        assert_eq!(run.status, RobotStatus::Interrupted { stopping: Stopping::Confirmed }, "{mode:?}");
        assert_eq!((run.record.samples, run.record.q.len()), (50, 100), "{mode:?}");
        let stop = StopSignal::default();
        stop.request();
        let (reference, controller) = (reference(), pd());
        let again =
            robot.run(&RunRequest { stop: Some(&stop), ..RunRequest::new(2, &reference, &controller) }).unwrap();
        assert_eq!((again.status.is_done(), again.record.samples), (false, 0));
    }
}

/// A program that does not answer its stop is killed, also behind a shell, and the verdict states that the robot may
/// still be moving.
#[test]
fn a_robot_that_ignores_its_stop_is_killed() {
    for shell in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let mut own = command("ignore", folder.path());
        if shell {
            let line = format!("'{}'; echo over >&2", own.join("' '"));
            own = ["sh", "-c", &line].map(str::to_owned).to_vec();
        }
        let mut settings = settings(ProcessMode::Run, own);
        settings.limits.stop_s = 0.2;
        let mut robot = process_robot(settings, joints()).unwrap();
        let run = stopped_at_the_mark(&mut robot, folder.path());
        assert_eq!(run.status, RobotStatus::Interrupted { stopping: Stopping::Unanswered });
        assert!(run.status.to_string().contains("check it first"));
        assert!(!runs(&marked(folder.path())), "behind a shell: {shell}");
    }
}

/// A minute of motion. The program runs as fast as possible or, paced, in real time, and fails after four seconds.
fn streamed(fault: &str, paced: bool, silence_s: Option<f64>) -> (RobotRun, Duration) {
    let folder = tempfile::tempdir().unwrap();
    let mut own = command(fault, folder.path());
    own.extend(["--at", "2000"].map(str::to_owned));
    if paced {
        own.extend(["--paced", "yes"].map(str::to_owned));
    }
    let mut settings = settings(ProcessMode::Run, own);
    settings.limits.silence_s = silence_s;
    settings.limits.stop_s = if fault == "ignore" { 0.2 } else { 60.0 };
    let (reference, controller) = (Reference::standing(&[-0.4, 0.3], 500.0, 60.0).unwrap(), pd());
    let begin = Instant::now();
    let run = process_robot(settings, joints()).unwrap().run(&RunRequest::new(1, &reference, &controller)).unwrap();
    (run, begin.elapsed())
}

/// A program that streams in real time and becomes silent during a motion is stopped after `silence_s` (one second,
/// because a busy machine pauses programs for longer than the default), and not after `message_s` plus the rest of the
/// motion, two minutes here.
#[test]
fn a_stream_that_falls_silent_is_stopped() {
    for (fault, expected) in [("wait", Stopping::Confirmed), ("ignore", Stopping::Unanswered)] {
        let (run, took) = streamed(fault, true, Some(1.0));
        let RobotStatus::Failed { fault: RobotFault::Silent { limit_s }, stopping } = run.status else {
            panic!("{fault}: {}", run.status)
        };
        assert_eq!((limit_s, stopping, run.record.samples), (1.0, Some(expected), 2000), "{fault}");
        // Four seconds of motion, the silence and the stop; the rest is a margin for a busy machine.
        assert!(took < Duration::from_secs(30), "{fault}: {took:?}");
    }
}

/// A program that does not stream in real time may pause; so may one with a larger stated limit.
#[test]
fn a_pause_of_what_is_no_stream_is_nothing() {
    let (run, _) = streamed("pause", false, None);
    assert!(run.status.is_done(), "{}", run.status);
    let folder = tempfile::tempdir().unwrap();
    let mut own = command("pause", folder.path());
    own.extend(["--at", "500", "--paced", "yes"].map(str::to_owned));
    let mut settings = settings(ProcessMode::Run, own);
    settings.limits.silence_s = Some(10.0);
    let (reference, controller) = (Reference::standing(&[-0.4, 0.3], 500.0, 1.5).unwrap(), pd());
    let run = process_robot(settings, joints()).unwrap().run(&RunRequest::new(1, &reference, &controller)).unwrap();
    assert!(run.status.is_done(), "{}", run.status);
}

/// A program that hangs behind a shell is killed with its group. If a program dies while its child process holds its
/// output open, its death is detected and the child is killed, too.
#[test]
fn no_process_of_a_robot_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!("'{}'; echo over >&2", command("hang", folder.path()).join("' '"));
    let mut settings = settings(ProcessMode::Run, ["sh", "-c", &line].map(str::to_owned).to_vec());
    settings.limits.run_s = Some(2.0);
    settings.limits.stop_s = 0.2;
    let (reference, controller) = (reference(), pd());
    let request = RunRequest::new(1, &reference, &controller);
    let run = process_robot(settings.clone(), joints()).unwrap().run(&request).unwrap();
    assert!(matches!(run.status, RobotStatus::Failed { fault: RobotFault::Hung { .. }, .. }), "{}", run.status);
    assert!(!runs(&marked(folder.path())));

    let folder = tempfile::tempdir().unwrap();
    settings = self::settings(ProcessMode::Run, command("orphan", folder.path()));
    // Far longer than this test may take: death is detected from the process.
    settings.limits.message_s = 3000.0;
    let run = process_robot(settings, joints()).unwrap().run(&request).unwrap();
    let RobotStatus::Failed { fault: RobotFault::Died { exit, said, .. }, .. } = &run.status else {
        panic!("{}", run.status)
    };
    assert!(exit.contains('4') && said.contains("left alone"), "{}", run.status);
    assert!(!runs(&marked(folder.path())));
}

#[test]
fn robots_can_be_killed_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(ProcessMode::Run, command("hang", folder.path()));
    settings.limits.message_s = 3000.0;
    let mut robot = process_robot(settings, joints()).unwrap();
    let stop = StopSignal::default();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            marked(folder.path());
            stop.kill_robots();
        });
        let (reference, controller) = (reference(), pd());
        let run = robot.run(&RunRequest { stop: Some(&stop), ..RunRequest::new(1, &reference, &controller) }).unwrap();
        let RobotStatus::Failed { fault: RobotFault::Died { exit, .. }, .. } = &run.status else {
            panic!("{}", run.status)
        };
        assert!(exit.contains('9'), "{exit}");
    });
    assert!(!runs(&marked(folder.path())));
}

fn envelope() -> Envelope {
    let none = vec![None, None];
    Envelope {
        lower: none.clone(),
        upper: none.clone(),
        speed: none.clone(),
        torque: none.clone(),
        tracking_error: none,
        workspace: None,
        speed_span_s: 0.01,
    }
}

fn watched(mode: ProcessMode, envelope: &Envelope, folder: &Path, unwatched: bool) -> RobotRun {
    let mut own = command("", folder);
    if unwatched {
        own.extend(["--unwatched", "yes"].map(str::to_owned));
    }
    let (reference, controller) = (reference(), pd());
    let mut robot = process_robot(settings(mode, own), joints()).unwrap();
    robot.run(&RunRequest { envelope: Some(envelope), ..RunRequest::new(1, &reference, &controller) }).unwrap()
}

/// The arm sags with joint PD: the first sample that is too far from the path ends the run, with joint, quantity,
/// value, limit and time, whether or not the program monitors the envelope; in mode `step` the next message to the
/// program is a stop.
#[test]
fn a_sample_outside_of_the_envelope_stops_the_run() {
    let tight = Envelope { tracking_error: vec![None, Some(0.01)], ..envelope() };
    for (mode, unwatched) in [(ProcessMode::Run, false), (ProcessMode::Run, true), (ProcessMode::Step, false)] {
        let folder = tempfile::tempdir().unwrap();
        let run = watched(mode, &tight, folder.path(), unwatched);
        let RobotStatus::LeftEnvelope { breach, stopping: Stopping::Confirmed } = &run.status else {
            panic!("{mode:?}: {}", run.status)
        };
        let Breach { joint, quantity, value, limit, time_s, .. } = breach.clone();
        assert_eq!((&*joint, quantity, limit), ("joint2", EnvelopeQuantity::TrackingError, 0.01));
        assert!(value.abs() > 0.01 && time_s > 0.0, "{breach}");
        let text = run.status.to_string();
        assert!(text.contains("tracking error of joint2") && text.contains("limit 0.0100"), "{text}");
        if mode == ProcessMode::Step {
            // The state of sample k follows k torques: none was sent after the breach.
            let last = run.record.samples - 1;
            assert!(marked(folder.path()).ends_with(&format!("after {last} torques")));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let weak = Envelope { torque: vec![Some(1.0), Some(1.0)], ..envelope() };
    let run = watched(ProcessMode::Step, &weak, folder.path(), false);
    assert!(matches!(&run.status, RobotStatus::LeftEnvelope { breach, .. }
        if breach.quantity == EnvelopeQuantity::Torque && breach.value.abs() > 1.0));
    assert!(run.record.samples > 1, "at rest on the path a joint PD asks for nothing");
    let wide = Envelope { tracking_error: vec![Some(3.0); 2], speed: vec![Some(50.0); 2], ..envelope() };
    for mode in BOTH {
        assert!(watched(mode, &wide, folder.path(), false).status.is_done());
    }
}

/// The lower of the planar arm's elbow and tip, and its height by trigonometry: axes along y, links of 0.5 and 0.4 m
/// along x.
fn lower_point(q: [f64; 2]) -> (&'static str, f64) {
    let elbow = -0.5 * q[0].sin();
    let tip = elbow - 0.4 * (q[0] + q[1]).sin();
    if tip < elbow { ("the tool", tip) } else { ("link2", elbow) }
}

/// Workspace box: the run ends at the first sample with elbow or tip outside, in both modes, whether or not the program
/// supports boxes (this one does not); the motion and its simulation are checked, too.
#[test]
fn a_link_that_leaves_the_workspace_stops_the_run() {
    let model = load_robot(urdf()).unwrap().model;
    let boxed = |lower: f64| {
        let low = [f64::NEG_INFINITY, f64::NEG_INFINITY, lower];
        let workspace = WorkspaceSettings { lower: low, tool: Some([0.4, 0.0, 0.0]), ..WorkspaceSettings::default() };
        Envelope { workspace: Some(workspace.of(&model).unwrap()), ..envelope() }
    };
    let folder = tempfile::tempdir().unwrap();
    let whole = watched(ProcessMode::Run, &boxed(-2.0), folder.path(), false);
    assert!(whole.status.is_done(), "{}", whole.status);
    let samples = whole.record.samples;
    let point = |sample: usize| lower_point([whole.record.q[sample], whole.record.q[samples + sample]]);
    let height = |sample: usize| point(sample).1;
    let lowest = (0..samples).map(height).fold(f64::INFINITY, f64::min);
    // Halfway from its begin to its lowest point.
    let limit = 0.5 * (height(0) + lowest);
    assert!(limit < height(0) - 1e-3, "{} to {lowest}", height(0));
    let first = (0..samples).find(|&sample| height(sample) < limit).unwrap();
    for mode in BOTH {
        let folder = tempfile::tempdir().unwrap();
        let run = watched(mode, &boxed(limit), folder.path(), false);
        let RobotStatus::LeftEnvelope { breach, stopping: Stopping::Confirmed } = &run.status else {
            panic!("{mode:?}: {}", run.status)
        };
        assert_eq!((&*breach.joint, breach.quantity, breach.limit), (point(first).0, EnvelopeQuantity::Z, limit));
        assert!((breach.value - height(first)).abs() < 1e-6, "{breach}: {}", height(first));
        assert!((breach.time_s - whole.record.times_s[first]).abs() < 1e-9, "{breach}");
        assert!(run.status.to_string().contains(&format!("z of {} is", point(first).0)), "{}", run.status);
    }
    // The input file lists the watched points.
    let told = serde_json::to_value(boxed(limit)).unwrap();
    assert_eq!(told["workspace"]["lower"], serde_json::json!([null, null, limit]));
    assert_eq!(told["workspace"]["points"][1]["link"], "the tool");
    let plant = Plant::new(&model, &[], &[]).unwrap();
    let mut simulator = SimulatedRobot::new(plant, LoopSettings::default()).unwrap();
    let (reference, controller) = (reference(), pd());
    let tight = boxed(limit);
    let request = RunRequest { envelope: Some(&tight), ..RunRequest::new(1, &reference, &controller) };
    let status = simulator.run(&request).unwrap().status;
    assert!(
        matches!(&status, RobotStatus::LeftEnvelope { breach, .. } if breach.quantity == EnvelopeQuantity::Z),
        "{status}"
    );
    // A box that the motion leaves; an empty box.
    let motion = reference.motion();
    let of_path = |sample: usize| lower_point([motion.q[sample], motion.q[motion.samples + sample]]).1;
    let path_lowest = (0..motion.samples).map(of_path).fold(f64::INFINITY, f64::min);
    let names = joints();
    assert_eq!(boxed(path_lowest - 1e-9).broken_by(&reference, &names), None);
    let broken = boxed(path_lowest + 1e-9).broken_by(&reference, &names).unwrap();
    assert!((broken.value - path_lowest).abs() < 1e-9 && broken.quantity == EnvelopeQuantity::Z, "{broken}");
    let none = WorkspaceSettings { upper: [0.0; 3], lower: [0.0; 3], tool: None };
    assert!(none.of(&model).unwrap_err().to_string().contains("envelope.workspace"));
}

/// A person's robot cannot be stopped, but a log that leaves the envelope is rejected.
#[test]
fn a_folders_log_is_watched_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let mut robot = FolderRobot::new(FolderSettings::new(folder.path()), joints()).unwrap();
    let (reference, controller) = (reference(), pd());
    let tight = Envelope { tracking_error: vec![Some(0.01); 2], ..envelope() };
    let request = RunRequest { envelope: Some(&tight), ..RunRequest::new(1, &reference, &controller) };
    assert!(matches!(robot.run(&request).unwrap().status, RobotStatus::Waiting { .. }));
    let file = std::fs::read_to_string(robot.run_folder(1).join("controller.json")).unwrap();
    let file: serde_json::Value = serde_json::from_str(&file).unwrap();
    assert_eq!(file["envelope"]["tracking_error"][1], 0.01);
    let plant = Plant::new(&load_robot(urdf()).unwrap().model, &[], &[]).unwrap();
    let mut simulator = SimulatedRobot::new(plant, LoopSettings::default()).unwrap();
    let simulated = simulator.run(&RunRequest::new(1, &reference, &controller)).unwrap();
    std::fs::write(robot.run_folder(1).join("log.csv"), simulated.record.csv()).unwrap();
    let status = robot.run(&request).unwrap().status;
    assert!(matches!(status, RobotStatus::LeftEnvelope { stopping: Stopping::SeenAfterwards, .. }), "{status}");
    let wide = Envelope { tracking_error: vec![Some(3.0); 2], ..envelope() };
    let run = robot.run(&RunRequest { envelope: Some(&wide), ..request }).unwrap();
    assert!(run.status.is_done(), "{}", run.status);
}

/// Samples may be sent after the motion: its length is added to the time limit for messages.
#[test]
fn samples_may_come_afterwards() {
    let folder = tempfile::tempdir().unwrap();
    let mut settings = settings(ProcessMode::Run, command("afterwards", folder.path()));
    // The program is silent for three quarters of the motion, 4.5 s; 2 + 6 s are allowed.
    settings.limits.message_s = 2.0;
    let reference = Reference::standing(&[-0.4, 0.3], 100.0, 6.0).unwrap();
    let controller = pd();
    let run = process_robot(settings, joints()).unwrap().run(&RunRequest::new(1, &reference, &controller)).unwrap();
    assert!(run.status.is_done(), "{}", run.status);
}

/// Stops after a number of runs; records the requests for permission.
struct Watcher {
    stop: StopSignal,
    stop_after: usize,
    asked: Vec<NextMotion>,
    made: usize,
}

impl Supervisor for Watcher {
    fn stop(&self) -> Option<&StopSignal> {
        Some(&self.stop)
    }

    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.asked.push(motion.clone());
        true
    }

    fn made(&mut self, _: &RunRecord, _: &[RobotRun]) {
        self.made += 1;
        if self.made == self.stop_after {
            self.stop.request();
        }
    }
}

fn iteration(safety: SafetySettings) -> Iteration {
    let robot = ParametricModel::new(load_robot(urdf()).unwrap().model, Vec::new()).unwrap();
    let mut settings = IterationSettings { model_free: pd(), controller: pd(), safety, ..IterationSettings::default() };
    // Prevents convergence, so that stops end the iteration.
    settings.settled.most_uncertain = 0.0;
    Iteration::new(IterationTask::new(robot, reference()).unwrap(), settings).unwrap()
}

fn watcher(stop_after: usize) -> Watcher {
    Watcher { stop: StopSignal::default(), stop_after, asked: Vec::new(), made: 0 }
}

#[test]
fn a_stop_between_runs_ends_the_iteration() {
    let folder = tempfile::tempdir().unwrap();
    let iteration = iteration(SafetySettings { outside: true, ..SafetySettings::default() });
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut robot = process_robot(settings(ProcessMode::Run, command("", folder.path())), joints()).unwrap();
    for runs in [1, 2] {
        let mut watcher = watcher(1);
        let outcome = iterate_supervised(&iteration, &mut [&mut robot], Some(&store), &mut watcher).unwrap();
        let IterationStatus::Interrupted { reason } = &outcome.status else { panic!("{}", outcome.status) };
        assert!(reason.contains(&format!("continue with run {}", runs + 1)), "{reason}");
        assert_eq!((outcome.runs.len(), watcher.asked.len()), (runs, 1));
        assert_eq!(watcher.asked[0].run, runs);
    }
}

/// During a run: the run is not used, its log is stored in a separate folder, and a fresh start removes it.
#[test]
fn a_run_that_is_cut_short_is_kept_aside() {
    let folder = tempfile::tempdir().unwrap();
    let iteration = iteration(SafetySettings { outside: true, ..SafetySettings::default() });
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut robot = process_robot(settings(ProcessMode::Run, command("wait", folder.path())), joints()).unwrap();
    let mut watcher = watcher(0);
    let stop = watcher.stop.clone();
    let outcome = std::thread::scope(|scope| {
        scope.spawn(|| {
            marked(folder.path());
            stop.request();
        });
        iterate_supervised(&iteration, &mut [&mut robot], Some(&store), &mut watcher).unwrap()
    });
    let IterationStatus::Interrupted { reason } = &outcome.status else { panic!("{}", outcome.status) };
    assert!(reason.contains("continue with run 1") && outcome.runs.is_empty(), "{reason}");
    let kept = folder.path().join("runs/interrupted_1");
    assert_eq!(std::fs::read_to_string(kept.join("log.csv")).unwrap().lines().count(), 51);
    assert!(store.records().unwrap().is_empty());
    IterationStore::open(folder.path(), "test", false).unwrap();
    assert!(!kept.exists());
}

/// A fault during a motion stops the robot like a breach: a program that answers has the time of a stop, even if it is
/// longer than that of a bye; the verdict states whether the stop was confirmed, and the log is stored.
#[test]
fn a_fault_in_the_middle_of_a_motion_is_a_stop() {
    for (fault, at) in [("nan", 50), ("joints", 50), ("backwards", 50), ("garbage", 50), ("megabyte", 50)] {
        let folder = tempfile::tempdir().unwrap();
        let mut own = command(fault, folder.path());
        own.extend(["--brakes".to_owned(), "700".to_owned()]);
        let iteration = iteration(SafetySettings { outside: true, ..SafetySettings::default() });
        let store = IterationStore::open(folder.path(), "test", true).unwrap();
        let mut robot = process_robot(settings(ProcessMode::Run, own), joints()).unwrap();
        let outcome = iterate_supervised(&iteration, &mut [&mut robot], Some(&store), &mut watcher(0)).unwrap();
        let IterationStatus::Refused { reason } = &outcome.status else { panic!("{fault}: {}", outcome.status) };
        let words = ["the robot has stopped", "its recorded part", "continue with run 1"];
        assert!(words.iter().all(|word| reason.contains(word)), "{fault}: {reason}");
        // The program ended by itself; it was not killed while its brakes were closing.
        assert_eq!(marked(folder.path()), "stands", "{fault}");
        let kept = std::fs::read_to_string(folder.path().join("runs/interrupted_1/log.csv")).unwrap();
        assert_eq!(kept.lines().count(), at + 1, "{fault}");
    }
    // Silent or dead programs: the stop is not confirmed.
    let open = [("hang", Stopping::Unanswered), ("die", Stopping::Unknown), ("short", Stopping::Unknown)];
    for (fault, expected) in open {
        let folder = tempfile::tempdir().unwrap();
        let mut settings = settings(ProcessMode::Run, command(fault, folder.path()));
        (settings.limits.message_s, settings.limits.stop_s) = (0.5, 0.3);
        let (reference, controller) = (reference(), pd());
        let run = process_robot(settings, joints()).unwrap().run(&RunRequest::new(1, &reference, &controller));
        let status = run.unwrap().status;
        let RobotStatus::Failed { stopping: Some(stopping), .. } = &status else { panic!("{fault}: {status}") };
        assert_eq!(*stopping, expected, "{fault}");
        assert!(status.to_string().contains("check it first"), "{status}");
    }
}

/// After a breach in the first run the next one begins with slow runs again, because its controller is untested.
#[test]
fn the_run_after_a_breach_begins_slow_again() {
    let folder = tempfile::tempdir().unwrap();
    let tight = Envelope { tracking_error: vec![Some(0.01); 2], ..envelope() };
    let safety = |envelope: Option<Envelope>, speed_steps: &[f64]| SafetySettings {
        outside: true,
        envelope,
        speed_steps: speed_steps.to_vec(),
        ..SafetySettings::default()
    };
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut robot = process_robot(settings(ProcessMode::Run, command("", folder.path())), joints()).unwrap();
    let outcome =
        iterate_supervised(&iteration(safety(Some(tight), &[])), &mut [&mut robot], Some(&store), &mut watcher(0));
    assert!(!outcome.unwrap().runs[0].done);
    let mut watcher = watcher(2);
    let iteration = iteration(safety(None, &[0.5, 1.0]));
    let outcome = iterate_supervised(&iteration, &mut [&mut robot], Some(&store), &mut watcher).unwrap();
    let speeds: Vec<(usize, f64)> = watcher.asked.iter().map(|motion| (motion.run, motion.speed)).collect();
    // After a completed run there are no slow runs.
    assert_eq!(speeds, [(2, 0.5), (2, 1.0), (3, 1.0)], "{}", outcome.status);
}

/// After an early end of a run of an external robot a person has to check it: one run per call.
#[test]
fn after_an_early_end_somebody_looks() {
    let folder = tempfile::tempdir().unwrap();
    let tight = Envelope { tracking_error: vec![Some(0.01); 2], ..envelope() };
    let iteration = iteration(SafetySettings { outside: true, envelope: Some(tight), ..SafetySettings::default() });
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut robot = process_robot(settings(ProcessMode::Run, command("", folder.path())), joints()).unwrap();
    for runs in [1, 2] {
        let outcome = iterate_supervised(&iteration, &mut [&mut robot], Some(&store), &mut watcher(0)).unwrap();
        let IterationStatus::Waiting { reason } = &outcome.status else { panic!("{}", outcome.status) };
        assert!(reason.contains("out of the envelope") && reason.contains("Check the robot"), "{reason}");
        assert_eq!(outcome.runs.len(), runs);
        assert!(outcome.runs.iter().all(|run| !run.done && !run.accepted));
    }
}

/// A fresh start removes only files of an iteration: not through a link, and no files of a person.
#[cfg(unix)]
#[test]
fn a_fresh_start_removes_only_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let iteration = iteration(SafetySettings::default());
    let plant = Plant::new(&load_robot(urdf()).unwrap().model, &[], &[]).unwrap();
    let mut robot = SimulatedRobot::new(plant, LoopSettings::default()).unwrap();
    let make = |folder: &Path, robot: &mut SimulatedRobot| {
        let store = IterationStore::open(folder, "test", true).unwrap();
        iterate_supervised(&iteration, &mut [robot], Some(&store), &mut watcher(1)).unwrap();
    };
    let own = folder.path().join("own");
    make(&own, &mut robot);
    let refused = |folder: &Path, what: &str| {
        let error = IterationStore::open(folder, "other", false).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    let notes = own.join("runs/run_1/notes.txt");
    std::fs::write(&notes, "cable loose").unwrap();
    refused(&own, "notes.txt");
    assert!(own.join("runs/run_1/run.json").exists());
    std::fs::remove_file(notes).unwrap();
    let link = folder.path().join("linked");
    std::fs::create_dir(&link).unwrap();
    std::os::unix::fs::symlink(own.join("runs"), link.join("runs")).unwrap();
    refused(&link, "symbolic link");
    assert!(own.join("runs/run_1/run.json").exists());
    std::fs::remove_file(link.join("runs")).unwrap();
    std::fs::create_dir(link.join("runs")).unwrap();
    std::os::unix::fs::symlink(own.join("runs/run_1"), link.join("runs/run_1")).unwrap();
    refused(&link, "move it to another folder");
    std::fs::create_dir(own.join("runs/run_fast")).unwrap();
    IterationStore::open(&own, "other", false).unwrap();
    assert!(own.join("runs/run_fast").exists() && !own.join("runs/run_1").exists());
}
