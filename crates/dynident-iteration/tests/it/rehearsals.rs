//! Before a motion is commanded: gains from a model, rehearsal, slow runs first.

use super::robots::{joints, pd, reference};
use dynident_dynamics::{ParametricModel, Workspace, mass_matrix};
use dynident_iteration::robot::{Envelope, EnvelopeSettings};
use dynident_iteration::{
    GainSettings, Iteration, IterationSettings, IterationStatus, IterationTask, RehearsalSettings, Robot, RobotRun,
    RunRequest, SafetySettings, SimulatedRobot, StartWith, derived_controllers, iterate,
};
use dynident_model::{Model, load_robot};
use dynident_simulation::controllers::{ControllerSettings, JointPdSettings};
use dynident_simulation::{LoopSettings, PerJoint, Plant, SimulationError};
use std::path::Path;

fn model() -> Model {
    load_robot(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/planar2r.urdf")).unwrap().model
}

fn robot() -> ParametricModel {
    ParametricModel::new(model(), Vec::new()).unwrap()
}

#[derive(Debug)]
struct Noted {
    inner: SimulatedRobot,
    motions: Vec<(f64, f64)>,
}

impl Noted {
    fn new() -> Self {
        let plant = Plant::new(&model(), &[], &[]).unwrap();
        Self { inner: SimulatedRobot::new(plant, LoopSettings::default()).unwrap(), motions: Vec::new() }
    }
}

impl Robot for Noted {
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        self.motions.push((request.speed, request.reference.duration_s()));
        self.inner.run(request)
    }
}

fn envelope() -> Envelope {
    let stated = EnvelopeSettings { tracking_error: Some(0.3.into()), ..EnvelopeSettings::default() };
    stated.envelope(&model()).unwrap()
}

fn safety(envelope: Envelope) -> SafetySettings {
    let rehearsal = Some(RehearsalSettings::default());
    SafetySettings { outside: true, envelope: Some(envelope), rehearsal, ..SafetySettings::default() }
}

fn refused(robot: ParametricModel, settings: IterationSettings) -> String {
    let iteration = Iteration::new(IterationTask::new(robot, reference()).unwrap(), settings).unwrap();
    let mut noted = Noted::new();
    let outcome = iterate(&iteration, &mut [&mut noted], None, &mut |_, _| {}).unwrap();
    let IterationStatus::Refused { reason } = outcome.status else { panic!("{}", outcome.status) };
    assert!(outcome.runs.is_empty() && noted.motions.is_empty(), "it was commanded: {reason}");
    reason
}

/// Gains that let the arm fall are detected in the rehearsal: nothing is commanded, and the message contains the fix.
#[test]
fn an_arm_that_would_fall_is_not_commanded() {
    let soft = ControllerSettings::JointPd(JointPdSettings { kp: 1.0.into(), kd: 0.5.into() });
    let settings = IterationSettings { model_free: soft, safety: safety(envelope()), ..IterationSettings::default() };
    let reason = refused(robot(), settings);
    assert!(reason.contains("does not follow the motion") && reason.contains("tracking error"), "{reason}");
    assert!(reason.contains("bandwidth_hz"), "{reason}");
}

/// A motion that reaches an end stop leaves no margin for the tracking error: the message requests a margin instead of
/// other gains.
#[test]
fn a_motion_up_to_the_stops_is_told_to_keep_off_them() {
    let motion = reference();
    let q = &motion.motion().q[..motion.samples()];
    let highest = q.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let tight = Envelope { upper: vec![Some(highest + 1e-9), None], ..envelope() };
    let settings = IterationSettings { model_free: pd(), safety: safety(tight), ..IterationSettings::default() };
    let reason = refused(robot(), settings);
    assert!(reason.contains("does not follow the motion") && reason.contains("position of joint1"), "{reason}");
    assert!(reason.contains("stop_margin_percent"), "{reason}");
}

#[test]
fn a_motion_outside_of_the_envelope_is_not_commanded() {
    let settings = |envelope: Envelope| IterationSettings {
        model_free: pd(),
        safety: safety(envelope),
        ..IterationSettings::default()
    };
    let weak = Envelope { torque: vec![Some(0.5), Some(0.5)], ..envelope() };
    let reason = refused(robot(), settings(weak));
    assert!(reason.contains("torque along the motion") && reason.contains("0.5000"), "{reason}");
    let narrow = Envelope { lower: vec![Some(-0.2), None], ..envelope() };
    let reason = refused(robot(), settings(narrow));
    assert!(reason.contains("motion leaves") && reason.contains("position of joint1"), "{reason}");
}

#[test]
fn a_model_without_a_mass_matrix_is_not_loaded() {
    let mut parameters = robot().nominal().to_vec();
    // Negative inertia of the tip about its axis.
    parameters[10..20].iter_mut().for_each(|value| *value *= -1.0);
    let impossible = robot().with_nominal(parameters).unwrap();
    let settings = IterationSettings {
        start: StartWith::Prior,
        controller: ControllerSettings::PdGravity(JointPdSettings { kp: 200.0.into(), kd: 20.0.into() }),
        safety: safety(envelope()),
        ..IterationSettings::default()
    };
    let reason = refused(impossible, settings);
    assert!(reason.contains("not positive definite"), "{reason}");
}

/// The result of a rehearsal is stored with the run: the smallest eigenvalue is that of the mass matrix over the
/// workspace.
#[test]
fn what_a_rehearsal_shows_is_kept() {
    // These gains are the simulator's, without delay.
    let rehearsal = Some(RehearsalSettings { delay_s: Some(0.0), ..RehearsalSettings::default() });
    let settings = IterationSettings {
        model_free: pd(),
        controller: pd(),
        safety: SafetySettings { rehearsal, ..safety(envelope()) },
        max_runs: 1,
        ..IterationSettings::default()
    };
    let iteration = Iteration::new(IterationTask::new(robot(), reference()).unwrap(), settings).unwrap();
    let outcome = iterate(&iteration, &mut [&mut Noted::new()], None, &mut |_, _| {}).unwrap();
    let shown = outcome.runs[0].rehearsal.as_ref().unwrap();
    let model = model();
    let matrix = mass_matrix(&model, &mut Workspace::new(&model), &[-0.4, 0.3]).to_vec();
    let own = nalgebra::DMatrix::from_fn(2, 2, |i, j| matrix[2 * i + j]).symmetric_eigenvalues().min();
    assert!(shown.smallest_eigenvalue > 0.0 && shown.smallest_eigenvalue <= own * (1.0 + 1e-12), "{shown:?} {own}");
    // Robots that are 30 % heavier sag more than the true one.
    let worst = outcome.runs[0].max_tracking_error_rad.iter().zip(&shown.largest_tracking_error_rad);
    assert!(worst.into_iter().all(|(run, rehearsed)| rehearsed >= run), "{shown:?}");
}

/// `K_p = ω² (1 - u) M_jj`, `K_d = 2 ω (1 - u) M_jj` for a motion at rest in one posture.
#[test]
fn gains_come_from_inertia_and_bandwidth() {
    let model = model();
    let matrix = mass_matrix(&model, &mut Workspace::new(&model), &[-0.4, 0.3]).to_vec();
    let gains = |bandwidth_hz: PerJoint| GainSettings {
        bandwidth_hz,
        uncertainty_percent: 30.0,
        delay_s: 0.0,
        lightest_drive: 0.1,
        light_delay_s: 0.0,
        tracking_error: None,
    };
    let derived = derived_controllers(&robot(), &[&reference()], &gains(vec![2.0, 3.0].into())).unwrap();
    let ControllerSettings::JointPd(pd) = &derived.model_free else { panic!("{derived:?}") };
    let ControllerSettings::ComputedTorque(computed) = &derived.model_based else { panic!("{derived:?}") };
    for (joint, bandwidth_hz) in [(0, 2.0), (1, 3.0)] {
        let omega = core::f64::consts::TAU * bandwidth_hz;
        let inertia = 0.7 * matrix[3 * joint];
        // Only rounding of a difference of torques.
        assert!((pd.kp.of(joint) / (omega * omega * inertia) - 1.0).abs() < 1e-10);
        assert!((pd.kd.of(joint) / (2.0 * omega * inertia) - 1.0).abs() < 1e-10);
        assert!((computed.kp.of(joint) - omega * omega).abs() < 1e-9);
    }
    assert!(derived_controllers(&robot(), &[&reference()], &gains(0.0.into())).is_err());
    let none = robot().with_nominal(vec![0.0; 20]).unwrap();
    let error = derived_controllers(&none, &[&reference()], &gains(2.0.into())).unwrap_err().to_string();
    assert!(error.contains("nominal inertia") && error.contains(&joints()[0]), "{error}");
}

#[test]
fn slow_runs_come_first() {
    let steps = SafetySettings { speed_steps: vec![0.1, 0.5, 1.0], ..SafetySettings::default() };
    let settings = IterationSettings {
        model_free: pd(),
        controller: pd(),
        safety: steps,
        max_runs: 2,
        ..IterationSettings::default()
    };
    let iteration = Iteration::new(IterationTask::new(robot(), reference()).unwrap(), settings).unwrap();
    let mut noted = Noted::new();
    let outcome = iterate(&iteration, &mut [&mut noted], None, &mut |_, _| {}).unwrap();
    assert_eq!(noted.motions, [(0.1, 4.0), (0.5, 0.8), (1.0, 0.4), (1.0, 0.4)]);
    assert_eq!(outcome.runs.len(), 2);
}
