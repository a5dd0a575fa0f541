//! The home posture: paths from there to the motion and back, in every mode, monitored, stopped, stored.

use super::robots::{client, joints, model, pd, process_robot};
use super::simulated_arm::{self, Simulated};
use dynident_excitation::Motion;
use dynident_excitation::limits::{FloorLimit, JointLimit, LimitKind, Limits, LinkPoint};
use dynident_iteration::robot::{
    ApproachPaths, Breach, ControlledRun, Envelope, EnvelopeQuantity, FolderRobot, FolderSettings, FunctionRobot,
    ProcessLimits, ProcessMode, ProcessRobot, ProcessSettings, RunPart, Stopping,
};
use dynident_iteration::{
    HomeError, HomeSettings, Iteration, IterationStatus, IterationStore, NextMotion, RehearsalSettings, Robot,
    RobotFault, RobotRun, RobotStatus, RunRecord, RunRequest, SimulatedRobot, StopSignal, Supervisor, iterate,
    iterate_supervised,
};
use dynident_simulation::{LoopSettings, Plant, Reference};
use std::path::Path;

const START: [f64; 2] = [-0.4, 0.3];
const END: [f64; 2] = [-0.1, 0.5];

/// From rest to rest between two postures in half a second.
fn motion(from: [f64; 2], to: [f64; 2]) -> Reference {
    let mut motion = Motion::default();
    motion.reset(2, 251);
    for at in 0..2 * 251 {
        let (joint, x) = (at / 251, (at % 251) as f64 / 250.0);
        let way = to[joint] - from[joint];
        motion.q[at] = from[joint] + way * x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x);
        motion.dq[at] = way * 30.0 * (x * (1.0 - x)).powi(2) / 0.5;
        motion.ddq[at] = way * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / 0.25;
    }
    // Exact end posture in spite of rounding.
    for joint in 0..2 {
        motion.q[joint * 251 + 250] = to[joint];
    }
    Reference::new(500.0, motion).unwrap()
}

fn home(posture: [f64; 2]) -> HomeSettings {
    let limit = |joint: &str| JointLimit {
        acceleration: Some(20.0),
        ..Limits::from_model(&model()).of(joint).unwrap().clone()
    };
    HomeSettings {
        posture: posture.to_vec(),
        speed: 0.5,
        limits: Limits { joints: vec![limit("joint1"), limit("joint2")], ..Limits::default() },
        uncertainty_percent: 30.0,
    }
}

fn ways() -> ApproachPaths {
    home([0.2, -0.1]).ways(&model(), &motion(START, END), None).unwrap().ways
}

fn simulator() -> SimulatedRobot {
    SimulatedRobot::new(Plant::new(&model(), &[], &[]).unwrap(), LoopSettings::default()).unwrap()
}

fn process(mode: ProcessMode, options: &[&str], folder: &Path) -> ProcessRobot {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf");
    let marker = folder.join("marker");
    let words = [&client(), &urdf, Path::new("--marker"), &marker];
    let command = words.iter().map(|word| word.to_str().unwrap()).chain(options.iter().copied());
    let limits = ProcessLimits { stop_s: 60.0, bye_s: 0.2, ..ProcessLimits::default() };
    let command = command.map(str::to_owned).collect();
    process_robot(ProcessSettings { command, mode, limits, folder: Some(folder.to_owned()) }, joints()).unwrap()
}

fn run(robot: &mut dyn Robot, ways: Option<&ApproachPaths>, envelope: Option<&Envelope>) -> RobotRun {
    let (reference, controller) = (motion(START, END), pd());
    robot.run(&RunRequest { ways, envelope, ..RunRequest::new(1, &reference, &controller) }).unwrap()
}

fn envelope(tracking_rad: f64) -> Envelope {
    let none = vec![None, None];
    Envelope {
        lower: none.clone(),
        upper: none.clone(),
        speed: none.clone(),
        torque: none.clone(),
        tracking_error: vec![Some(tracking_rad); 2],
        workspace: None,
        speed_span_s: 0.01,
    }
}

/// `q̇` and `q̈` are within half of the limits, one of them nearly at its limit; each path is from rest to rest and
/// exactly from posture to posture.
#[test]
fn ways_are_as_fast_as_they_may_be() {
    let ways = ways();
    for (way, from, to) in [(&ways.approach, [0.2, -0.1], START), (&ways.back, END, [0.2, -0.1])] {
        let (motion, last) = (way.motion(), way.samples() - 1);
        let mut most = 0.0_f64;
        for joint in 0..2 {
            let own = motion.of(joint);
            let (q, dq, ddq) = (&motion.q[own.clone()], &motion.dq[own.clone()], &motion.ddq[own]);
            assert_eq!((q[0], q[last], dq[0], dq[last]), (from[joint], to[joint], 0.0, 0.0));
            assert!(ddq[0].abs() < 1e-12 && ddq[last].abs() < 1e-12);
            let highest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            most = most.max(highest(dq) / (0.5 * [4.0, 5.0][joint])).max(highest(ddq) / (0.5 * 20.0));
            // Velocities are derivatives of the positions.
            for k in 1..last {
                assert!(((q[k + 1] - q[k - 1]) * 250.0 - dq[k]).abs() < 1e-3);
            }
        }
        // Rounding to multiples of 100 samples may make the path slower.
        assert!(most <= 1.0 + 1e-9 && most > 0.5, "{most}");
    }
    let there = home(START).ways(&model(), &motion(START, START), None).unwrap().ways;
    assert_eq!((there.approach.samples(), there.back.samples()), (1, 1));
    // Without stated velocity limits, those of the motion are used.
    let free = HomeSettings { limits: Limits::default(), ..home([0.2, -0.1]) };
    let reference = motion(START, END);
    let highest = |of: &Reference| of.motion().dq[of.motion().of(0)].iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let slow = free.ways(&model(), &reference, None).unwrap().ways;
    assert!(highest(&slow.approach) <= 0.5 * highest(&reference) * (1.0 + 1e-9));
    let held = motion([-0.4, 0.3], [-0.1, 0.3]);
    assert!(matches!(free.ways(&model(), &held, None), Err(HomeError::NoSpeed { joint }) if joint == "joint2"));
}

/// Height of the tip from the described lengths; joints turn from x towards -z.
fn tip_m(q: [f64; 2]) -> f64 {
    -0.5 * q[0].sin() - 0.4 * (q[0] + q[1]).sin()
}

/// If the direct path crosses the floor, the path goes through via postures and stays above the floor. If there is no
/// path, or a posture is too low, the message names the obstacle.
#[test]
fn a_floor_is_gone_around_or_named() {
    let below = |height_m: f64, posture: [f64; 2]| {
        let points = vec![LinkPoint { link: "link2".to_owned(), at_m: [0.4, 0.0, 0.0], radius_m: 0.0 }];
        let mut home = home(posture);
        home.limits.floor = Some(FloorLimit { height_m, points, ..FloorLimit::default() });
        home
    };
    let (from, to) = ([0.3, 0.0], [2.8, 0.0]);
    let reference = motion(to, to);
    let found = below(-0.65, from).ways(&model(), &reference, None).unwrap();
    assert!(!found.over[0].is_empty() && found.over[0] == found.over[1]);
    let lowest = |way: &Reference| {
        let (q, n) = (&way.motion().q, way.samples());
        (0..n).map(|k| tip_m([q[k], q[n + k]])).fold(f64::INFINITY, f64::min)
    };
    assert!(lowest(&found.ways.approach) >= -0.65 && lowest(&found.ways.back) >= -0.65);
    assert!(tip_m([1.55, 0.0]) < -0.85, "the direct path is far below");
    assert_eq!(below(-0.65, from).ways(&model(), &reference, None).unwrap(), found);
    // No motion of the elbow avoids a floor that is this high.
    let error = below(-0.3, from).ways(&model(), &reference, None).map(|_| ()).unwrap_err();
    assert!(
        matches!(&error, HomeError::Posture { kind: LimitKind::Floor, posture: "the motion's first posture", .. }),
        "{error}"
    );
    let error = below(-0.31, from).ways(&model(), &motion([2.82, 0.0], [2.82, 0.0]), None).map(|_| ()).unwrap_err();
    let HomeError::NotClear { kind: LimitKind::Floor, share, .. } = &error else { panic!("{error}") };
    // The lowest point is reached when the arm hangs down.
    assert!((share - 0.5).abs() < 0.2, "{error}");
    assert!(error.to_string().contains("floor of link2"), "{error}");
    let error = below(-0.65, [1.5, 0.0]).ways(&model(), &reference, None).map(|_| ()).unwrap_err();
    assert!(error.to_string().starts_with("home itself breaks the limit of floor"), "{error}");
}

/// A path keeps the torque limits for all robots within the uncertainty.
#[test]
fn the_torque_of_a_way_has_room() {
    // Horizontal, the arm needs 15.2 Nm at joint 1; with 30 % more 19.8 Nm.
    let mut level = home([0.0, 0.0]);
    level.limits.joints[0].torque = Some(18.0);
    let reference = motion([1.0, 0.0], [1.0, 0.0]);
    let error = level.ways(&model(), &reference, None).map(|_| ()).unwrap_err();
    assert!(matches!(&error, HomeError::Posture { kind: LimitKind::Torque, posture: "home", .. }), "{error}");
    level.uncertainty_percent = 0.0;
    assert!(level.ways(&model(), &reference, None).is_ok());
    let mut moving = reference.motion().clone();
    moving.dq.fill(0.3);
    let moving = Reference::new(500.0, moving).unwrap();
    let error = level.ways(&model(), &moving, None).map(|_| ()).unwrap_err();
    assert!(matches!(&error, HomeError::NotAtRest { begins: true, .. }), "{error}");
}

/// In all modes the three parts are the same, and the record of the motion contains only the motion.
#[test]
fn every_robot_runs_the_ways() {
    let ways = ways();
    let own = run(&mut simulator(), Some(&ways), None);
    assert!(own.status.is_done());
    let parts = own.ways.as_ref().unwrap();
    let samples = [parts.approach.samples, own.record.samples, parts.back.samples];
    assert_eq!(samples, [ways.approach.samples() - 1, 251, ways.back.samples() - 1]);
    assert_eq!(parts.approach.q[0], 0.2);
    assert!((own.record.q[0] - START[0]).abs() < 0.1 && own.record.times_s[0] == 0.0);
    assert!((parts.back.q[samples[2] - 1] - 0.2).abs() < 0.1);
    let truth = own.truth.as_ref().unwrap();
    assert_eq!((truth.samples, &truth.q[..251]), (251, &own.record.q[..251]));
    assert_eq!(truth.max_error, own.max_error(&motion(START, END)));
    let folder = tempfile::tempdir().unwrap();
    for mode in [ProcessMode::Run, ProcessMode::Step] {
        let mut robot = process(mode, &[], folder.path());
        for _ in 0..2 {
            let theirs = run(&mut robot, Some(&ways), Some(&envelope(1.0)));
            assert!(theirs.status.is_done(), "{mode:?}: {}", theirs.status);
            assert!(theirs.record.q == own.record.q && theirs.record.tau == own.record.tau, "{mode:?}");
            let off = theirs.record.times_s.iter().zip(&own.record.times_s).map(|(a, b)| (a - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-9);
            let kept = theirs.ways.unwrap();
            assert!(kept.approach.q == parts.approach.q && kept.back.tau == parts.back.tau, "{mode:?}");
        }
        assert!(run(&mut robot, None, None).status.is_done());
    }
    let tables = ["approach.csv", "trajectory.csv", "return.csv"]
        .map(|name| std::fs::read_to_string(folder.path().join("run_1").join(name)).unwrap().lines().count() - 1);
    assert_eq!(tables, [ways.approach.samples(), 251, ways.back.samples()]);
    // A function that is always at the requested position; its clock begins at 5 s.
    let mut asked = 0;
    let mut function = FunctionRobot::new(joints(), |mut run: ControlledRun| {
        let whole = run.reference().clone();
        for sample in 0..whole.samples() {
            let q = [0, 1].map(|joint| whole.motion().q[joint * whole.samples() + sample]);
            asked += usize::from(run.torque(5.0 + sample as f64 / 500.0, &q, &[0.0; 2]).is_some());
        }
        (run, Ok(()))
    });
    let stood = run(&mut function, Some(&ways), None);
    assert!(stood.status.is_done(), "{}", stood.status);
    assert_eq!(asked, samples.iter().sum::<usize>());
    assert_eq!((stood.record.samples, stood.record.q[0], stood.record.times_s[0]), (251, START[0], 0.0));
    let kept = stood.ways.unwrap();
    assert!((kept.back.times_s[0] - 0.002).abs() < 1e-9 && kept.back.samples == samples[2]);
}

/// A program without the capability `home` would start the motion from home at once, so it is not sent a run. Mode
/// `step` does not need the capability.
#[test]
fn a_program_that_knows_no_ways_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let ways = ways();
    let old = ["--fault", "homeless"];
    let run_ = run(&mut process(ProcessMode::Run, &old, folder.path()), Some(&ways), None);
    assert!(matches!(run_.status, RobotStatus::Failed { fault: RobotFault::NoWays, .. }), "{}", run_.status);
    assert!(run_.record.samples == 0 && run_.status.to_string().contains("mode = \"step\""), "{}", run_.status);
    assert!(run(&mut process(ProcessMode::Run, &old, folder.path()), None, None).status.is_done());
    assert!(run(&mut process(ProcessMode::Step, &old, folder.path()), Some(&ways), None).status.is_done());
}

/// A sample outside of the envelope stops the run, on a path as well as in the motion; the robot does not return home.
#[test]
fn a_breach_ends_the_run_where_it_is() {
    let ways = ways();
    // Home is the begin of the motion: joint PD without gravity sags in the motion.
    let at_start = home(START).ways(&model(), &motion(START, END), None).unwrap().ways;
    assert_eq!(at_start.approach.samples(), 1);
    for mode in [ProcessMode::Run, ProcessMode::Step] {
        for (ways, part) in [(&ways, RunPart::Approach), (&at_start, RunPart::Motion)] {
            let folder = tempfile::tempdir().unwrap();
            let run = run(&mut process(mode, &[], folder.path()), Some(ways), Some(&envelope(0.01)));
            let RobotStatus::LeftEnvelope { breach, stopping: Stopping::Confirmed } = &run.status else {
                panic!("{mode:?}: {}", run.status)
            };
            let Breach { quantity, part: found, time_s, .. } = breach;
            assert_eq!((*found, *quantity), (part, EnvelopeQuantity::TrackingError));
            let kept = run.ways.unwrap();
            let of_part = if part == RunPart::Motion { &run.record } else { &kept.approach };
            assert_eq!((*time_s, kept.back.samples), (of_part.times_s[of_part.samples - 1], 0));
            assert_eq!(run.record.samples > 0, part == RunPart::Motion);
            let marked = std::fs::read_to_string(folder.path().join("marker")).unwrap();
            let said = match mode {
                ProcessMode::Run => format!("in the {} at {}", part.name(), of_part.samples - 1),
                ProcessMode::Step => format!("after {} torques", of_part.samples - 1),
            };
            assert!(marked.ends_with(&said), "{mode:?}: {marked}, {said}");
            assert_eq!(breach.to_string().contains("of the approach"), part == RunPart::Approach);
        }
    }
}

/// A robot that stops on its way home has not completed the run; invalid parts of samples are detected.
#[test]
fn a_way_that_is_not_run_to_its_end() {
    let ways = ways();
    let folder = tempfile::tempdir().unwrap();
    let fault = |name: &str, part: &str| {
        let options = ["--fault", name, "--part", part];
        run(&mut process(ProcessMode::Run, &options, folder.path()), Some(&ways), None)
    };
    let stopped = fault("stop", "return");
    assert!(matches!(&stopped.status, RobotStatus::Stopped { .. }));
    assert_eq!((stopped.record.samples, stopped.ways.unwrap().back.samples), (251, 49));
    let short = fault("short", "approach").status;
    assert!(
        matches!(&short, RobotStatus::Failed { fault: RobotFault::Short { part: RunPart::Approach, .. }, .. }),
        "{short}"
    );
    // The program's error is a sample of the motion during the approach.
    let early = fault("null", "approach").status;
    assert!(
        matches!(&early, RobotStatus::Failed { fault: RobotFault::Short { part: RunPart::Approach, .. }, .. }),
        "{early}"
    );
    let late = fault("null", "return").status;
    assert!(matches!(&late, RobotStatus::Failed { fault: RobotFault::OutOfTurn { .. }, .. }), "{late}");
}

#[test]
fn a_folder_holds_the_ways() {
    let folder = tempfile::tempdir().unwrap();
    let settings = FolderSettings::new(folder.path());
    let mut robot = FolderRobot::new(settings, joints()).unwrap();
    let ways = ways();
    let waiting = run(&mut robot, Some(&ways), None).status.to_string();
    assert!(waiting.contains("approach.csv, trajectory.csv and return.csv"), "{waiting}");
    let own = robot.run_folder(1);
    let file: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(own.join("controller.json")).unwrap()).unwrap();
    assert_eq!(file["home"]["approach_s"], ways.approach.duration_s());
    assert!(own.join("approach.csv").exists() && own.join("return.csv").exists());
    let simulated = run(&mut simulator(), Some(&ways), None);
    std::fs::write(own.join("log.csv"), simulated.record.csv()).unwrap();
    assert!(run(&mut robot, Some(&ways), None).status.is_done());
    // A corrected home posture does not invalidate an existing log.
    let other = home([0.25, -0.1]).ways(&model(), &motion(START, END), None).unwrap().ways;
    assert!(run(&mut robot, Some(&other), None).status.is_done());
    let logs = simulated.ways.unwrap();
    std::fs::write(own.join("approach_log.csv"), logs.approach.csv()).unwrap();
    std::fs::write(own.join("return_log.csv"), logs.back.csv()).unwrap();
    let wide = run(&mut robot, Some(&ways), Some(&envelope(1.0)));
    assert!(wide.status.is_done() && wide.ways.is_some(), "{}", wide.status);
    // The log of the motion is inside the envelope, that of a path is not.
    let mut high = envelope(1.0);
    high.upper = vec![Some(0.1), None];
    let status = run(&mut robot, Some(&ways), Some(&high)).status;
    let RobotStatus::LeftEnvelope { breach, stopping: Stopping::SeenAfterwards } = status else { panic!("{status}") };
    assert_eq!((breach.part, breach.quantity), (RunPart::Approach, EnvelopeQuantity::Position));
}

struct Asked(Vec<NextMotion>);

impl Supervisor for Asked {
    fn allows(&mut self, motion: &NextMotion) -> bool {
        self.0.push(motion.clone());
        true
    }

    fn made(&mut self, _: &RunRecord, _: &[RobotRun]) {}

    fn stop(&self) -> Option<&StopSignal> {
        None
    }
}

fn with_home(posture: [f64; 2]) -> dynident_iteration::IterationSettings {
    let mut settings = simulated_arm::settings();
    settings.safety.home = Some(HomeSettings {
        posture: posture.to_vec(),
        speed: 0.5,
        limits: Limits::default(),
        uncertainty_percent: 30.0,
    });
    settings
}

/// A complete iteration in which every run starts and ends at home: it converges to the truth, resumes bit for bit,
/// stores the logs of the paths, and a fresh start removes them.
#[test]
fn an_iteration_from_home() {
    let simulated = Simulated::default();
    let mut settings = with_home([-0.5, 0.4]);
    settings.safety.speed_steps = vec![0.5];
    let iteration = Iteration::new(simulated_arm::task(), settings).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let store = IterationStore::open(folder.path(), "test", true).unwrap();
    let mut asked = Asked(Vec::new());
    let outcome = iterate_supervised(&iteration, &mut [&mut simulated.robot()], Some(&store), &mut asked).unwrap();
    assert_eq!(outcome.status, IterationStatus::Converged, "{:?}", outcome.shortfalls);
    let known = outcome.runs.last().unwrap().knowledge().unwrap();
    let described = simulated_arm::described();
    for ((value, std), truth) in known.values.iter().zip(&known.std).zip(simulated.truth(&described)) {
        // Eight parameters: 4.5 standard deviations do not occur by chance.
        assert!((value - truth).abs() < 4.5 * std, "{value} {truth} {std}");
    }
    // Requests for permission: the slow run first, with paths at the same speed.
    let shown = |place: usize| asked.0[place].ways.as_ref().unwrap();
    assert!(asked.0[0].speed == 0.5 && asked.0[1].speed == 1.0);
    assert_eq!(shown(0).approach_s, 2.0 * shown(1).approach_s);
    assert!(shown(1).approach_s > 0.5 && shown(1).over_postures == [0, 0]);
    let highest = |name: &str| shown(1).largest_speed.iter().find(|own| own.0 == name).unwrap().1;
    assert!(highest("joint1") > 0.0);
    let files = ["log.csv", "approach_log.csv", "return_log.csv"].map(|name| store.run_folder(1).join(name));
    assert!(files.iter().all(|file| file.exists()));
    let runs = outcome.runs.len();
    std::fs::remove_dir_all(store.run_folder(runs)).unwrap();
    let again = iterate(&iteration, &mut [&mut simulated.robot()], Some(&store), &mut |_, _| {}).unwrap();
    assert_eq!(again.runs, outcome.runs);
    IterationStore::open(folder.path(), "test", false).unwrap();
    assert!(!files[0].exists());
}

#[test]
fn a_way_is_rehearsed() {
    let simulated = Simulated::default();
    let refused = |settings| {
        let iteration = Iteration::new(simulated_arm::task(), settings).unwrap();
        let mut asked = Asked(Vec::new());
        let outcome = iterate_supervised(&iteration, &mut [&mut simulated.robot()], None, &mut asked).unwrap();
        let IterationStatus::Refused { reason } = outcome.status else { panic!("{}", outcome.status) };
        assert!(outcome.runs.is_empty() && asked.0.is_empty());
        reason
    };
    let mut settings = with_home([-1.5, 0.4]);
    settings.safety.rehearsal = Some(RehearsalSettings { robots: 0, postures: 10, ..RehearsalSettings::default() });
    // The motion keeps joint 1 above -1 rad.
    let mut narrow = envelope(1.0);
    narrow.lower = vec![Some(-1.0), None];
    settings.safety.envelope = Some(narrow);
    let reason = refused(settings);
    assert!(reason.contains("the motion leaves the envelope") && reason.contains("-1.5"), "{reason}");
    let mut settings = with_home([-0.5, 0.4]);
    if let Some(home) = &mut settings.safety.home {
        home.limits.joints.push(JointLimit {
            joint: "joint1".to_owned(),
            position: Some([-0.4, 3.0]),
            ..JointLimit::default()
        });
    }
    let reason = refused(settings);
    assert!(reason.contains("run 1 is not commanded: home itself breaks the limit of position of joint1"), "{reason}");
}

#[test]
fn a_search_for_ways_ends() {
    for at in 1..=5 {
        let asked = core::cell::Cell::new(0);
        let stop = || {
            asked.set(asked.get() + 1);
            asked.get() >= at
        };
        let ended = home([0.2, -0.1]).ways_until(&model(), &motion(START, END), None, &stop);
        assert!(matches!(ended, Err(HomeError::Interrupted)), "{at}: {ended:?}");
        assert_eq!(asked.get(), at);
    }
}
