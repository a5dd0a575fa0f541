//! A run is identified like any log: every estimator, selected friction, delays, payloads.

use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_identification::EstimationSettings;
use dynident_identification::estimators::{Estimator, InstrumentSettings, NoiseLevels};
use dynident_identification::friction::FrictionSearch;
use dynident_identification::payload::Payload;
use dynident_iteration::robot::RunRequest;
use dynident_iteration::{
    Iteration, IterationError, IterationSettings, IterationTask, Leg, Robot, RunEstimate, RunIdentificationSettings,
    SimulatedRobot, identify_run, iterate,
};
use dynident_model::sample::planar_2r;
use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm, Viscous};
use dynident_model::{InertialParameters, Model};
use dynident_simulation::controllers::{ComputedTorqueSettings, JointPdSettings};
use dynident_simulation::{
    ControllerSettings, FrictionCompensation, Integrator, LoopSettings, Plant, Record, Reference, SensorSettings,
};

const RATE_HZ: f64 = 500.0;

fn arm(tip_kg: f64) -> Model {
    let rod = InertialParameters([1.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 1.0, 0.0, 1.0]);
    let tip = InertialParameters(rod.0.map(|value| tip_kg * value));
    planar_2r(1.0, rod, tip)
}

fn friction(shape: CoulombShape) -> Vec<TorqueTerm> {
    let of_joint = |joint| [TorqueTerm::Viscous(Viscous { joint }), TorqueTerm::Coulomb(Coulomb { joint, shape })];
    (0..2).flat_map(of_joint).collect()
}

/// Sums of sines that start and end at rest, 20 s.
fn reference() -> Reference {
    let samples = (20.0 * RATE_HZ) as usize;
    let mut motion = Motion { samples, joints: 2, ..Motion::default() };
    for (amplitude, first) in [(0.6, 1.0), (0.8, 1.4)] {
        for sample in 0..samples {
            let t = sample as f64 / RATE_HZ;
            let term = |w: f64| {
                [amplitude * (1.0 - (w * t).cos()), amplitude * w * (w * t).sin(), amplitude * w * w * (w * t).cos()]
            };
            let (a, b) = (term(first), term(2.3 * first));
            motion.q.push(a[0] + 0.4 * b[0]);
            motion.dq.push(a[1] + 0.4 * b[1]);
            motion.ddq.push(a[2] + 0.4 * b[2]);
        }
    }
    Reference::new(RATE_HZ, motion).unwrap()
}

fn robot(model: &Model, shape: CoulombShape, sensors: SensorSettings) -> SimulatedRobot {
    let plant = Plant::new(model, &friction(shape), &[0.8, 1.5, 0.5, 1.0]).unwrap();
    // A semi-implicit Euler step delays the effect of the torque by half a sample: a lag of a millisecond here.
    let integrator = Integrator::Rk4 { steps_per_sample: 4 };
    SimulatedRobot::new(plant, LoopSettings { integrator, sensors, ..LoopSettings::default() }).unwrap()
}

fn pd() -> ControllerSettings {
    ControllerSettings::JointPd(JointPdSettings { kp: vec![400.0, 200.0].into(), kd: vec![60.0, 30.0].into() })
}

fn computed_torque() -> ControllerSettings {
    let (kp, kd) = (100.0.into(), 20.0.into());
    ControllerSettings::ComputedTorque(ComputedTorqueSettings { kp, kd, friction: FrictionCompensation::default() })
}

fn noise() -> SensorSettings {
    SensorSettings { position_std: 1e-6.into(), torque_std: 0.05.into(), ..SensorSettings::default() }
}

fn record(model: &Model, shape: CoulombShape) -> Record {
    let reference = reference();
    let controller = pd();
    let request = RunRequest::new(1, &reference, &controller);
    robot(model, shape, noise()).run(&request).unwrap().record
}

fn task(shape: CoulombShape) -> IterationTask {
    let robot = ParametricModel::new(arm(1.0), friction(shape)).unwrap();
    IterationTask::new(robot, reference()).unwrap()
}

fn settings(estimator: Estimator) -> RunIdentificationSettings {
    RunIdentificationSettings { estimation: EstimationSettings::of(estimator), ..RunIdentificationSettings::default() }
}

fn friction_of(task: &IterationTask, estimate: &RunEstimate) -> Vec<[f64; 2]> {
    let symbols: Vec<String> = task.robot.layout().columns().iter().map(dynident_dynamics::Column::symbol).collect();
    let value = |symbol: &str| {
        let place = symbols.iter().position(|other| other == symbol).unwrap();
        [estimate.values[place], estimate.std[place]]
    };
    ["fv1", "fc1", "fv2", "fc2"].map(value).to_vec()
}

#[test]
fn every_estimator_that_needs_no_more_than_a_log_identifies_a_run() {
    let shape = CoulombShape::Smooth { width: 0.02 };
    let (task, record) = (task(shape), record(&arm(1.0), shape));
    let instruments = InstrumentSettings { cutoff_hz: Some(6.0), ..InstrumentSettings::default() };
    let estimators = [
        Estimator::Ordinary,
        Estimator::Weighted,
        Estimator::Generalized,
        Estimator::Huber,
        Estimator::Tukey,
        Estimator::NoiseWeighted(NoiseLevels::default()),
        Estimator::Instrumental(instruments),
    ];
    for estimator in estimators {
        let name = estimator.name();
        let found = identify_run(&task, std::slice::from_ref(&record), &settings(estimator)).unwrap();
        for ([found, std], truth) in friction_of(&task, &found).into_iter().zip([0.8, 1.5, 0.5, 1.0]) {
            // Five error bars, or a twentieth of the Coulomb friction, whose step the smoothing blurs.
            assert!((found - truth).abs() < (5.0 * std).max(0.05) && std < 0.3, "{name}: {found} +- {std} for {truth}");
        }
        assert!(found.possible.is_some(), "{name}: {:?}", found.impossible);
        // The only delay of the record is half a sample of held torque, which is compensated.
        let lags: Vec<f64> = found.torque_lags.iter().flatten().map(|lag| lag.lag_s).collect();
        assert!(lags.iter().all(|lag| lag.abs() < 1e-3), "{name}: {lags:?}");
    }
}

#[test]
fn friction_is_chosen_once_and_kept_by_the_runs_after() {
    let (stated, true_step) = (CoulombShape::Smooth { width: 0.5 }, CoulombShape::Smooth { width: 0.01 });
    let task = task(stated);
    let mut identification = settings(Estimator::Weighted);
    identification.friction = ["joint1", "joint2"]
        .iter()
        .zip(task.robot.joint_names())
        .map(|(_, name)| FrictionSearch { coulomb: Some(stated), ..FrictionSearch::of(name) })
        .collect::<Vec<_>>()
        .into();
    let settings = IterationSettings {
        identification,
        model_free: pd(),
        controller: computed_torque(),
        max_runs: 2,
        ..IterationSettings::default()
    };
    let iteration = Iteration::new(task, settings).unwrap();
    let mut simulated = robot(&arm(1.0), true_step, noise());
    let outcome = iterate(&iteration, &mut [&mut simulated], None, &mut |_, _| {}).unwrap();
    let [first, second] = &outcome.runs[..] else { panic!("{:?}", outcome.status) };
    let (first, second) = (first.estimate.as_ref().unwrap(), second.estimate.as_ref().unwrap());
    assert!(first.friction.iter().all(|joint| joint.terms.is_some()), "{:?}", first.friction);
    assert!(second.friction.is_empty());
    let chosen = iteration.robot(&outcome.runs).unwrap();
    // A step that is fifty times narrower than the stated one is detected.
    let widths: Vec<CoulombShape> = chosen
        .terms()
        .iter()
        .filter_map(|term| if let TorqueTerm::Coulomb(term) = term { Some(term.shape) } else { None })
        .collect();
    assert!(widths.iter().all(|shape| *shape != stated), "{widths:?}");
    assert_eq!(second.values.len(), chosen.base().count());
    // Stored runs are read back: a killed iteration continues with the selected terms.
    let text = serde_json::to_string(&outcome.runs).unwrap();
    let read: Vec<dynident_iteration::RunRecord> = serde_json::from_str(&text).unwrap();
    assert_eq!(iteration.robot(&read).unwrap().terms(), chosen.terms());
    let mut of_another = read;
    let friction = &mut of_another[0].estimate.as_mut().unwrap().friction;
    friction[0].terms = Some(vec![TorqueTerm::Viscous(Viscous { joint: 7 })]);
    for error in [iteration.robot(&of_another).unwrap_err(), iteration.next(&of_another).unwrap_err()] {
        assert!(matches!(error, IterationError::ChosenFriction { run: 1, .. }), "{error}");
    }
}

#[test]
fn a_payload_that_is_known_is_taken_off() {
    let shape = CoulombShape::Smooth { width: 0.02 };
    let mut task = task(shape);
    let link = task.robot.model().bodies()[1].links[0].name.clone();
    // A tip of twice the mass is the arm with a payload of the same ten parameters.
    let known = Some(task.robot.model().inertials()[1]);
    let mut settings = settings(Estimator::Weighted);
    settings.payloads = vec![Payload { name: "weight".to_owned(), link, known, known_mass_kg: None }];
    task.legs = vec![Leg::whole(reference()).unwrap().with_payload(Some("weight".to_owned()))];
    let record = record(&arm(2.0), shape);
    let found = identify_run(&task, std::slice::from_ref(&record), &settings).unwrap();
    let truth = task.robot.nominal_base().unwrap();
    for (k, truth) in truth.iter().enumerate().filter(|(_, truth)| **truth != 0.0) {
        // Only bodies, because friction has no nominal value. If the payload were not subtracted, the first moments
        // would be too large by 1 and 2.
        let (value, std) = (found.values[k], found.std[k]);
        assert!((value - truth).abs() < 5.0 * std && std < 0.2, "{k}: {value} +- {std} for {truth}");
    }
}
