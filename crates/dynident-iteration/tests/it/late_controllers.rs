//! Delayed controllers: gains that tolerate the delay, and the rehearsal that detects it.

use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::robot::EnvelopeSettings;
use dynident_iteration::{
    DerivedControllers, GainSettings, Iteration, IterationOutcome, IterationSettings, IterationStatus, IterationTask,
    RehearsalSettings, SafetySettings, SimulatedRobot, StartWith, derived_controllers, iterate, lowered_bandwidths,
};
use dynident_model::terms::{DriveInertia, TorqueTerm, Viscous};
use dynident_model::{InertialParameters, load_robot};
use dynident_simulation::controllers::{ControllerModel, ControllerSettings, JointPdSettings};
use dynident_simulation::{LoopSettings, Plant, Reference, SensorSettings, closed_loop};
use std::path::Path;

const RATE_HZ: f64 = 500.0;
/// 8 ms in samples.
const LATE: usize = 4;

/// A UR10 that folds and stretches its arm: the inertia about its first joints changes by a factor of ten.
fn folding() -> (ParametricModel, Reference) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/ur10.urdf");
    let model = load_robot(&path).unwrap().model;
    let mut motion = Motion::default();
    let samples = 4000;
    motion.reset(6, samples);
    let omega = core::f64::consts::TAU * RATE_HZ / samples as f64;
    let [lift, elbow] = [motion.of(1), motion.of(2)];
    for sample in 0..samples {
        let phase = omega * sample as f64 / RATE_HZ;
        motion.q[lift.start + sample] = -1.2;
        motion.q[elbow.start + sample] = 1.4 * (1.0 - phase.cos());
        motion.dq[elbow.start + sample] = 1.4 * omega * phase.sin();
        motion.ddq[elbow.start + sample] = 1.4 * omega * omega * phase.cos();
    }
    (ParametricModel::new(model, Vec::new()).unwrap(), Reference::new(RATE_HZ, motion).unwrap())
}

fn derived(delay_s: f64) -> DerivedControllers {
    let (robot, reference) = folding();
    derived_controllers(&robot, &[&reference], &gains_of(delay_s)).unwrap()
}

/// 4 Hz with drives of at least typical inertia.
fn gains_of(delay_s: f64) -> GainSettings {
    let (bandwidth_hz, uncertainty_percent, light_delay_s) = (4.0.into(), 30.0, delay_s);
    GainSettings {
        bandwidth_hz,
        uncertainty_percent,
        delay_s,
        lightest_drive: 1.0,
        light_delay_s,
        tracking_error: None,
    }
}

fn joint_pd(derived: &DerivedControllers) -> JointPdSettings {
    let ControllerSettings::JointPd(pd) = &derived.model_free else { panic!("{derived:?}") };
    pd.clone()
}

/// Largest tracking error of a robot with scaled masses and compensated gravity, so that only the delay causes errors;
/// infinite if the run ends early.
fn largest_error(gains: &JointPdSettings, mass: f64) -> f64 {
    let (robot, reference) = folding();
    let bodies = robot.model().inertial_count();
    let parameters: Vec<f64> = robot.nominal()[..bodies].iter().map(|own| mass * own).collect();
    let inertials: Vec<InertialParameters> =
        parameters.chunks_exact(10).map(|own| InertialParameters(own.try_into().unwrap())).collect();
    let mut plant = Plant::new(&robot.model().with_inertials(&inertials).unwrap(), &[], &[]).unwrap();
    let known = ControllerModel::from_parameters(robot.model(), &[], &parameters).unwrap();
    let mut controller = ControllerSettings::PdGravity(gains.clone()).build(6, Some(&known)).unwrap();
    let sensors = SensorSettings { feedback_delay_samples: LATE, ..SensorSettings::default() };
    let looped = LoopSettings { sensors, ..LoopSettings::default() };
    let run = closed_loop(&mut plant, controller.as_mut(), &reference, &looped).unwrap();
    run.max_error.iter().copied().fold(if run.status.is_done() { 0.0 } else { f64::INFINITY }, f64::max)
}

/// Joint PD at 4 Hz oscillates with 8 ms of delay, because a folded arm has a much lower inertia than its gains assume.
/// The derived gains tolerate it for all masses within the uncertainty; without a delay they have the requested
/// bandwidth.
#[test]
fn derived_gains_hold_a_late_controller() {
    let names = folding().0.joint_names();
    let (fast, slow) = (derived(0.0), derived(LATE as f64 / RATE_HZ));
    assert!(lowered_bandwidths("none", &fast.model_free_hz, &names, &4.0.into()).is_empty());
    let lowered = lowered_bandwidths("none", &slow.model_free_hz, &names, &4.0.into());
    assert!(lowered.iter().any(|one| one.joint == names[0] && one.hz < 4.0 && one.hz > 0.5), "{lowered:?}");
    // An error of 0.3 rad stops a robot by default.
    assert!(largest_error(&joint_pd(&fast), 0.7) > 1.0);
    for mass in [0.7, 1.0, 1.3] {
        let error = largest_error(&joint_pd(&slow), mass);
        assert!(error < 0.3, "{mass}: {error}");
    }
}

/// The first run of `gains` with compensated gravity, rehearsed with that delay (default if `None`).
fn rehearsed(gains: &JointPdSettings, delay_s: Option<f64>) -> IterationOutcome {
    let (robot, reference) = folding();
    let stated = EnvelopeSettings { tracking_error: Some(0.5.into()), ..EnvelopeSettings::default() };
    let safety = SafetySettings {
        envelope: Some(stated.envelope(robot.model()).unwrap()),
        rehearsal: Some(RehearsalSettings { delay_s, ..RehearsalSettings::default() }),
        ..SafetySettings::default()
    };
    let first = Some(ControllerSettings::PdGravity(gains.clone()));
    let settings =
        IterationSettings { start: StartWith::Prior, first, safety, max_runs: 1, ..IterationSettings::default() };
    let plant = Plant::new(robot.model(), &[], &[]).unwrap();
    let mut simulated = SimulatedRobot::new(plant, LoopSettings::default()).unwrap();
    let iteration = Iteration::new(IterationTask::new(robot, reference).unwrap(), settings).unwrap();
    iterate(&iteration, &mut [&mut simulated], None, &mut |_, _| {}).unwrap()
}

/// Gains that are unstable with the delay are refused before anything moves; the message contains the delay and its
/// key. If the study states no delay, the same gains are commanded; derived gains always are.
#[test]
fn a_late_controller_is_rehearsed() {
    let fast = joint_pd(&derived(0.0));
    let refused = rehearsed(&fast, None);
    let IterationStatus::Refused { reason } = &refused.status else { panic!("{}", refused.status) };
    assert!(refused.runs.is_empty() && reason.contains("ms of controller delay (rehearsal.delay_s)"), "{reason}");
    let own_s = RehearsalSettings::default().delay_s(folding().0.model());
    for (gains, delay_s) in [(fast, Some(0.0)), (joint_pd(&derived(own_s)), None)] {
        let commanded = rehearsed(&gains, delay_s);
        assert_eq!(commanded.runs.len(), 1, "{}", commanded.status);
    }
}

/// Without described drives, the first model has typical drive inertia and no friction, which would be overcompensated
/// if it does not exist. With 8 ms of delay computed torque has a higher bandwidth than joint PD, because its gains
/// depend on the posture.
#[test]
fn the_first_model_has_typical_drives() {
    let (bare, reference) = folding();
    let drives = (0..6)
        .flat_map(|joint| [TorqueTerm::DriveInertia(DriveInertia { joint }), TorqueTerm::Viscous(Viscous { joint })]);
    let robot = ParametricModel::new(bare.model().clone(), drives.collect()).unwrap();
    let gains = gains_of(0.008);
    let derived = derived_controllers(&robot, &[&reference], &gains).unwrap();
    assert!(matches!(derived.first, ControllerSettings::ComputedTorque(_)), "{:?}", derived.first);
    let terms = &derived.first_model.unwrap()[robot.model().inertial_count()..];
    let own = robot.model().characteristic_scale();
    for (joint, pair) in terms.chunks_exact(2).enumerate() {
        let effort = robot.model().joints()[joint].limits.effort.unwrap();
        let typical = effort / own.acceleration(true, 300.0);
        assert!((pair[0] / typical - 1.0).abs() < 1e-12 && pair[1] == 0.0, "{joint}: {pair:?}");
    }
    assert!(derived.first_hz.iter().zip(&derived.model_free_hz).all(|(first, without)| first > without));
    // Stated drive parameters are used.
    assert!(derived_controllers(&bare, &[&reference], &gains).unwrap().first_model.is_none());
}
