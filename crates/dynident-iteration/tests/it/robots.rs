//! The robot interface: the same run by the simulator, by a program in both modes, and by a folder; and a timely
//! verdict for all failures of programs and people.

use dynident_excitation::Motion;
use dynident_iteration::robot::{
    Envelope, FolderRobot, FolderSettings, ProcessLimits, ProcessMode, ProcessRobot, ProcessSettings, ToClient, ToHost,
    WayFiles, controller_json, trajectory_csv,
};
use dynident_iteration::{Robot, RobotFault, RobotRun, RobotStatus, RunRequest, SimulatedRobot};
use dynident_model::terms::{
    Coulomb, CoulombShape, Direction, DirectionalCoulomb, DirectionalViscous, DriveInertia, LoadFriction, Offset,
    Power, PowerExponent, Sigmoid, Stribeck, TorqueTerm, Viscous,
};
use dynident_model::{Model, load_robot};
use dynident_simulation::controllers::{
    ComputedTorqueSettings, FiniteTimeSettings, JointPdSettings, PositionLoopSettings,
};
use dynident_simulation::{ControllerModel, ControllerSettings, LoopSettings, Plant, Reference, SimulationError};
use dynident_system::ProgramPermission;
use std::path::{Path, PathBuf};
use std::time::Instant;

type IsExpected = fn(&RobotFault) -> bool;

pub(crate) fn model() -> Model {
    load_robot(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf")).unwrap().model
}

/// The example program next to this test: `cargo test` builds it.
pub(crate) fn client() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    test.parent()
        .unwrap()
        .parent()
        .unwrap()
        .join("examples")
        .join(format!("robot_client{}", std::env::consts::EXE_SUFFIX))
}

fn settings(mode: ProcessMode, fault: &str) -> ProcessSettings {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf");
    let mut command = vec![client().to_str().unwrap().to_owned(), urdf.to_str().unwrap().to_owned()];
    if !fault.is_empty() {
        command.extend(["--fault".to_owned(), fault.to_owned()]);
    }
    let limits = ProcessLimits { hello_s: 20.0, message_s: 20.0, stop_s: 0.5, bye_s: 0.2, ..ProcessLimits::default() };
    ProcessSettings { command, mode, limits, folder: None }
}

pub(crate) fn joints() -> Vec<String> {
    vec!["joint1".to_owned(), "joint2".to_owned()]
}

pub(crate) fn pd() -> ControllerSettings {
    ControllerSettings::JointPd(JointPdSettings { kp: vec![200.0, 80.0].into(), kd: vec![20.0, 8.0].into() })
}

pub(crate) fn reference() -> Reference {
    Reference::standing(&[-0.4, 0.3], 500.0, 0.4).unwrap()
}

fn run(robot: &mut dyn Robot) -> RobotRun {
    let (reference, controller) = (reference(), pd());
    robot.run(&RunRequest::new(1, &reference, &controller)).unwrap()
}

fn fault(mode: ProcessMode, name: &str) -> (RobotFault, RobotRun) {
    let mut robot = process_robot(settings(mode, name), joints()).unwrap();
    let run = run(&mut robot);
    let RobotStatus::Failed { fault, .. } = run.status.clone() else { panic!("{name}: {}", run.status) };
    (fault, run)
}

pub(crate) fn process_robot(settings: ProcessSettings, joints: Vec<String>) -> Result<ProcessRobot, SimulationError> {
    let program = settings.permitted(ProgramPermission::Allow).unwrap();
    ProcessRobot::new(settings, joints, program)
}

/// A program that serves the simulator returns the same samples as the simulator, bit for bit, in both modes and with
/// another order of joints; also in a second run of the same program.
#[test]
fn programs_give_what_the_simulator_gives() {
    let plant = Plant::new(&model(), &[], &[]).unwrap();
    let own = run(&mut SimulatedRobot::new(plant, LoopSettings::default()).unwrap());
    assert!(own.status.is_done());
    for mode in [ProcessMode::Run, ProcessMode::Step] {
        let mut robot = process_robot(settings(mode, ""), joints()).unwrap();
        for _ in 0..2 {
            let theirs = run(&mut robot);
            assert!(theirs.status.is_done(), "{mode:?}: {}", theirs.status);
            assert!(theirs.record == own.record, "{mode:?}");
            assert_eq!(theirs.max_error(&reference()), own.max_error(&reference()));
        }
    }
}

#[test]
fn programs_that_fail_have_a_verdict() {
    let at_50: [(&str, IsExpected); 9] = [
        (
            "die",
            |fault| matches!(fault, RobotFault::Died { exit, said, .. } if exit.contains('3') && said.contains("fire")),
        ),
        ("garbage", |fault| matches!(fault, RobotFault::Garbage { line, .. } if line.starts_with("Segmentation"))),
        ("nan", |fault| matches!(fault, RobotFault::NotANumber { sample: 50, .. })),
        ("null", |fault| matches!(fault, RobotFault::NotANumber { sample: 50, .. })),
        ("joints", |fault| matches!(fault, RobotFault::WrongJoints { sample: 50, expected: 2, found: 3, .. })),
        ("backwards", |fault| matches!(fault, RobotFault::Time { sample: 50, .. })),
        ("megabyte", |fault| matches!(fault, RobotFault::Garbage { .. })),
        ("turn", |fault| matches!(fault, RobotFault::OutOfTurn { found, .. } if found == "state")),
        ("short", |fault| matches!(fault, RobotFault::Short { .. })),
    ];
    for (name, expected) in at_50 {
        let (fault, run) = fault(ProcessMode::Run, name);
        assert!(expected(&fault), "{name}: {fault}");
        assert_eq!((run.record.samples, run.record.q.len(), run.record.tau.len()), (50, 100, 100), "{name}");
    }
    let (flood, run) = fault(ProcessMode::Run, "flood");
    assert!(matches!(flood, RobotFault::TooMuch { .. }) && run.record.samples == 100 * 201 + 1000, "{flood}");
    for mode in [ProcessMode::Run, ProcessMode::Step] {
        assert!(matches!(fault(mode, "protocol").0, RobotFault::Protocol { .. }));
        assert!(matches!(fault(mode, "modes").0, RobotFault::Protocol { .. }));
        assert!(matches!(fault(mode, "names").0, RobotFault::OtherJoints { .. }));
    }
    let (died, run) = fault(ProcessMode::Step, "die");
    assert!(matches!(died, RobotFault::Died { .. }) && run.record.samples == 50, "{died}");
    let stopped = self::run(&mut process_robot(settings(ProcessMode::Run, "stop"), joints()).unwrap());
    assert!(matches!(&stopped.status, RobotStatus::Stopped { reason } if reason == "protective stop"));
    assert_eq!(stopped.record.samples, 50);
}

/// A program that hangs is killed at the time limit, long before its hour is over.
#[test]
fn programs_that_hang_are_given_up() {
    let limits =
        |hello_s, message_s, run_s| ProcessLimits { hello_s, message_s, run_s, bye_s: 0.1, ..ProcessLimits::default() };
    for (mode, name, limits) in [
        (ProcessMode::Run, "hang", limits(20.0, 0.4, None)),
        (ProcessMode::Step, "hang", limits(20.0, 0.4, None)),
        (ProcessMode::Run, "hang", limits(20.0, 3000.0, Some(1.0))),
        (ProcessMode::Run, "deaf", limits(0.4, 20.0, None)),
    ] {
        let start = Instant::now();
        let mut robot = process_robot(ProcessSettings { limits, ..settings(mode, name) }, joints()).unwrap();
        let run = run(&mut robot);
        assert!(matches!(run.status, RobotStatus::Failed { fault: RobotFault::Hung { .. }, .. }), "{}", run.status);
        // 3600 s without the limits.
        assert!(start.elapsed().as_secs() < 600);
    }
}

#[test]
fn programs_that_are_not_there_are_named() {
    let command = vec!["/nowhere/robot".to_owned()];
    let settings = ProcessSettings { command, ..settings(ProcessMode::Run, "") };
    let status = run(&mut process_robot(settings.clone(), joints()).unwrap()).status;
    assert!(matches!(&status, RobotStatus::Failed { fault: RobotFault::NotStarted { .. }, .. }));
    assert!(status.to_string().contains("/nowhere/robot"));
    assert!(process_robot(ProcessSettings { command: Vec::new(), ..settings }, joints()).is_err());
}

/// The folder robot waits for a complete log, and reports the error in one that cannot be read.
#[test]
fn a_folder_waits_for_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let settings = FolderSettings::new(folder.path());
    let mut robot = FolderRobot::new(settings, joints()).unwrap();
    let waiting = |run: &RobotRun, what: &str| {
        assert!(matches!(&run.status, RobotStatus::Waiting { reason, .. } if reason.contains(what)), "{}", run.status);
    };
    waiting(&run(&mut robot), "log.csv");
    let own = robot.run_folder(1);
    assert!(own.join("trajectory.csv").exists() && own.join("controller.json").exists());
    let plant = Plant::new(&model(), &[], &[]).unwrap();
    let simulated = run(&mut SimulatedRobot::new(plant, LoopSettings::default()).unwrap());
    let csv = simulated.record.csv();
    let log = own.join("log.csv");
    std::fs::write(&log, &csv[..csv.len() / 2]).unwrap();
    waiting(&run(&mut robot), "not complete");
    let half: String = csv.lines().take(100).flat_map(|line| [line, "\n"]).collect();
    std::fs::write(&log, &half).unwrap();
    waiting(&run(&mut robot), "covers");
    std::fs::write(&log, csv.replacen(",-0.4,", ",oops,", 1)).unwrap();
    let broken = run(&mut robot).status;
    assert!(matches!(broken, RobotStatus::Failed { .. }) && broken.to_string().contains("line 2"), "{broken}");
    std::fs::write(&log, &csv).unwrap();
    let done = run(&mut robot);
    assert!(done.status.is_done());
    assert_eq!(done.record, simulated.record);
    let other = Reference::standing(&[-0.4, 0.31], 500.0, 0.4).unwrap();
    let controller = pd();
    let request = RunRequest::new(1, &other, &controller);
    let refused = robot.run(&request).unwrap().status;
    assert!(matches!(refused, RobotStatus::Failed { .. }) && refused.to_string().contains("another run"), "{refused}");
    std::fs::write(&log, &half).unwrap();
    std::fs::write(own.join("stopped.txt"), "protective stop\n").unwrap();
    let stopped = run(&mut robot);
    assert!(matches!(&stopped.status, RobotStatus::Stopped { reason } if reason == "protective stop"));
    assert_eq!(stopped.record.samples, 99);
}

/// The lines in the book follow the protocol: those of a program can be read, and those of Dynident are what it writes.
#[test]
fn the_book_tells_the_protocol() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/robot-protocol.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (trajectory, controller) = ("/…/run_1/trajectory.csv".to_owned(), "/…/run_1/controller.json".to_owned());
    let (approach, back) = ("/…/run_1/approach.csv".to_owned(), "/…/run_1/return.csv".to_owned());
    let home = WayFiles { approach, approach_s: 4.2, back, return_s: 4.2 };
    let each = |limit: f64| vec![Some(limit), Some(limit)];
    let envelope = Some(Envelope {
        lower: vec![Some(-2.9), None],
        upper: vec![Some(2.9), None],
        speed: each(2.5),
        torque: vec![Some(96.0), Some(30.0)],
        tracking_error: each(0.3),
        workspace: None,
        speed_span_s: 0.01,
    });
    let own = [
        ToClient::Run {
            run: 1,
            rate_hz: 1000.0,
            duration_s: 10.0,
            trajectory: trajectory.clone(),
            controller: controller.clone(),
            envelope: envelope.clone(),
            home: None,
        },
        ToClient::Run {
            run: 1,
            rate_hz: 1000.0,
            duration_s: 10.0,
            trajectory,
            controller,
            envelope: None,
            home: Some(home),
        },
        ToClient::Begin { run: 1, rate_hz: 1000.0, samples: 10_001, q: vec![0.1, 0.2], dq: vec![0.0, 0.0], envelope },
        ToClient::Torque { tau: vec![3.1, 0.4] },
        ToClient::Finish {},
        ToClient::Stop { reason: "interrupted".to_owned() },
        ToClient::Bye {},
    ];
    let mut own: Vec<String> = own.iter().map(|message| serde_json::to_string(message).unwrap()).collect();
    assert!(page.contains(&own.pop().unwrap()));
    let mut read = 0;
    for line in page.lines().filter(|line| line.starts_with('{')) {
        if !own.contains(&line.to_owned()) {
            serde_json::from_str::<ToHost>(line).unwrap_or_else(|error| panic!("{line}: {error}"));
            read += 1;
        }
    }
    assert!(read >= 7 && own.iter().all(|line| page.contains(line)), "{read}");
}

/// The input files contain the controller's torque: the table has the model's inverse dynamics, the file the model's
/// parameters.
#[test]
fn what_is_handed_over_is_enough() {
    let model = model();
    let believed = ControllerModel::new(&model, &[], &[]).unwrap();
    let reference = reference();
    let csv = trajectory_csv(&reference, Some(&believed));
    let mut lines = csv.lines();
    assert_eq!(lines.next().unwrap(), "t_s,q1,q2,dq1,dq2,ddq1,ddq2,tau1,tau2");
    let row: Vec<f64> = lines.next().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    let mut workspace = dynident_dynamics::Workspace::new(&model);
    let weight = dynident_dynamics::gravity_torque(&model, &mut workspace, &[-0.4, 0.3]);
    assert_eq!((&row[1..3], &row[7..]), (&[-0.4, 0.3][..], weight));
    assert_eq!(csv.lines().count(), 202);
    let controller = ControllerSettings::ComputedTorque(ComputedTorqueSettings {
        kp: 100.0.into(),
        kd: 20.0.into(),
        friction: dynident_simulation::FrictionCompensation::None,
    });
    let request = RunRequest { model: Some(&believed), ..RunRequest::new(3, &reference, &controller) };
    let file = controller_json(&request, &joints());
    assert_eq!(file["schema"], "dynident/controller/1");
    assert_eq!(file["controller"]["kind"], "computed-torque");
    let inertial: Vec<f64> = serde_json::from_value(file["model"]["joints"][1]["inertial"].clone()).unwrap();
    assert_eq!(inertial, model.inertials()[1].0);
    assert_eq!(file["model"]["joints"][1]["parent"], "joint1");
    let mut robot = process_robot(settings(ProcessMode::Run, ""), joints()).unwrap();
    assert!(robot.run(&RunRequest { model: None, ..request }).is_err());
}

/// Drives with a position loop without feed-forward get no torques, because a program adds the torques of the table.
#[test]
fn a_loop_without_feed_forward_gets_no_torques() {
    let believed = ControllerModel::new(&model(), &[], &[]).unwrap();
    let reference = reference();
    for feed_forward in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let settings = FolderSettings::new(folder.path());
        let mut robot = FolderRobot::new(settings, joints()).unwrap();
        let controller = ControllerSettings::PositionLoop(PositionLoopSettings::of_robot(feed_forward));
        let request = RunRequest { model: Some(&believed), ..RunRequest::new(1, &reference, &controller) };
        robot.run(&request).unwrap();
        let table = std::fs::read_to_string(robot.run_folder(1).join("trajectory.csv")).unwrap();
        assert_eq!(table.lines().next().unwrap().contains("tau1"), feed_forward);
    }
}

/// MuJoCo behind the example program, in both modes and with four controllers, compared with the built-in simulator.
/// Needs Python with MuJoCo: DYNIDENT_PYTHON is the interpreter.
#[test]
#[ignore = "needs Python with MuJoCo in DYNIDENT_PYTHON; .ci/run runs it"]
fn mujoco_is_a_robot() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let python = std::env::var("DYNIDENT_PYTHON").unwrap();
    let path = |name: &str| root.join(name).to_str().unwrap().to_owned();
    let urdf = "robots/panda_arm7.urdf";
    let model = load_robot(root.join(urdf)).unwrap().model;
    let names: Vec<String> = model.joints().iter().map(|joint| joint.name.clone()).collect();
    let mut motion = Motion::default();
    motion.reset(7, 501);
    for at in 0..7 * 501 {
        let (joint, time_s) = (at / 501, (at % 501) as f64 / 1000.0);
        let omega = 2.0 + 0.5 * joint as f64;
        let (sine, cosine) = (omega * time_s).sin_cos();
        let centre = [0.1, 0.2, 0.3, -1.6, 0.5, 1.6, 0.7][joint];
        (motion.q[at], motion.dq[at], motion.ddq[at]) =
            (centre + 0.3 * sine, 0.3 * omega * cosine, -0.3 * omega * omega * sine);
    }
    let reference = Reference::new(1000.0, motion).unwrap();
    let terms: Vec<TorqueTerm> = (0..7).map(|joint| TorqueTerm::Viscous(Viscous { joint })).collect();
    // Friction in the controller's model: one law of each kind without memory.
    let shape = CoulombShape::Smooth { width: 0.05 };
    let mut laws = terms.clone();
    laws.extend([
        TorqueTerm::Coulomb(Coulomb { joint: 0, shape }),
        TorqueTerm::Stribeck(Stribeck { joint: 0, speed: 0.2, exponent: 1.5, shape }),
        TorqueTerm::Sigmoid(Sigmoid { joint: 1, steepness: 8.0, offset_speed: 0.1 }),
        TorqueTerm::Power(Power { joint: 2, exponent: PowerExponent::CubeRoot, rounding: 1e-3 }),
        TorqueTerm::Power(Power { joint: 3, exponent: PowerExponent::Quadratic, rounding: 1e-3 }),
        TorqueTerm::Load(LoadFriction { joint: 3, shape }),
        TorqueTerm::DirectionalCoulomb(DirectionalCoulomb { joint: 4, direction: Direction::Forward, shape }),
        TorqueTerm::DirectionalViscous(DirectionalViscous { joint: 5, direction: Direction::Backward }),
        TorqueTerm::DriveInertia(DriveInertia { joint: 6 }),
        TorqueTerm::Offset(Offset { joint: 6 }),
    ]);
    let values: Vec<f64> = core::iter::repeat_n(0.4, 7).chain(core::iter::repeat_n(0.1, laws.len() - 7)).collect();
    let believed = ControllerModel::new(&model, &laws, &values).unwrap();
    let friction = dynident_simulation::FrictionCompensation::Measured;
    let gains = JointPdSettings { kp: vec![300.0, 300.0, 200.0, 200.0, 60.0, 60.0, 10.0].into(), kd: 0.5.into() };
    let controllers = [
        ControllerSettings::JointPd(gains.clone()),
        ControllerSettings::PdGravity(gains),
        ControllerSettings::ComputedTorque(ComputedTorqueSettings { kp: 100.0.into(), kd: 20.0.into(), friction }),
        ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(8.0, 6.0)),
    ];
    for mode in [ProcessMode::Run, ProcessMode::Step] {
        let command = vec![python.clone(), path("examples/robots/mujoco_client.py"), path(urdf)];
        let command = command.into_iter().chain(["--damping", "0.5"].map(str::to_owned)).collect();
        let settings = ProcessSettings { command, ..settings(mode, "") };
        let mut mujoco = process_robot(settings, names.clone()).unwrap();
        let plant = Plant::new(&model, &terms, &[0.5; 7]).unwrap();
        let mut own = SimulatedRobot::new(plant, LoopSettings::default()).unwrap();
        for controller in &controllers {
            let request = RunRequest { model: Some(&believed), ..RunRequest::new(1, &reference, controller) };
            let (theirs, own) = (mujoco.run(&request).unwrap(), own.run(&request).unwrap());
            assert!(theirs.status.is_done(), "{}: {}", controller.name(), theirs.status);
            let worst = theirs.record.q.iter().zip(&own.record.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let error = own.max_error(&reference).into_iter().fold(0.0, f64::max);
            println!("{mode:?} {}: {worst:.1e} rad; largest tracking error {error:.1e} rad", controller.name());
            assert!(worst < 1e-9, "{mode:?} {}: {worst:e}", controller.name());
        }
    }
}
