//! A planar arm with friction and noise, and an iteration that converges for a correct robot.

use dynident_dynamics::ParametricModel;
use dynident_excitation::Motion;
use dynident_iteration::{
    Iteration, IterationOutcome, IterationSettings, IterationTask, SimulatedRobot, StartWith, iterate,
};
use dynident_model::sample::planar_2r;
use dynident_model::terms::{Coulomb, CoulombShape, TorqueTerm, Viscous};
use dynident_model::{InertialParameters, Model};
use dynident_recording::{DecimationSettings, DifferentiatorSettings};
use dynident_simulation::controllers::{FiniteTimeSettings, JointPdSettings};
use dynident_simulation::{ControllerSettings, Integrator, LoopSettings, Plant, Reference, RunLimits, SensorSettings};

pub(crate) const RATE_HZ: f64 = 500.0;

/// The simulated robot: deviations from the robot description, properties of the drives and of the log.
pub(crate) struct Simulated {
    pub(crate) length_m: f64,
    pub(crate) tip_kg: f64,
    pub(crate) shape: CoulombShape,
    pub(crate) coulomb: [f64; 2],
    pub(crate) limits: RunLimits,
    pub(crate) sensors: SensorSettings,
}

impl Default for Simulated {
    fn default() -> Self {
        let sensors =
            SensorSettings { position_std: 2e-5.into(), torque_std: 0.05.into(), seed: 1, ..SensorSettings::default() };
        let shape = CoulombShape::Smooth { width: 0.1 };
        Self { length_m: 1.0, tip_kg: 1.3, shape, coulomb: [1.5, 1.0], limits: RunLimits::default(), sensors }
    }
}

pub(crate) fn arm(length_m: f64, tip_kg: f64) -> Model {
    let rod = InertialParameters([1.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 1.2, 0.0, 1.2]);
    planar_2r(length_m, rod, InertialParameters(rod.0.map(|value| tip_kg * value)))
}

pub(crate) fn friction(shape: CoulombShape) -> Vec<TorqueTerm> {
    let of_joint = |joint| [TorqueTerm::Viscous(Viscous { joint }), TorqueTerm::Coulomb(Coulomb { joint, shape })];
    (0..2).flat_map(of_joint).collect()
}

impl Simulated {
    pub(crate) fn robot(&self) -> SimulatedRobot {
        let [one, two] = self.coulomb;
        let plant = Plant::new(&arm(self.length_m, self.tip_kg), &friction(self.shape), &[0.8, one, 0.5, two]).unwrap();
        let settings = LoopSettings {
            integrator: Integrator::Rk4 { steps_per_sample: 1 },
            limits: self.limits.clone(),
            sensors: self.sensors.clone(),
            ..LoopSettings::default()
        };
        SimulatedRobot::new(plant, settings).unwrap()
    }

    pub(crate) fn parameters(&self) -> Vec<f64> {
        let [one, two] = self.coulomb;
        let mut all = arm(1.0, self.tip_kg).parameter_vector();
        all.extend([0.8, one, 0.5, two]);
        all
    }

    pub(crate) fn truth(&self, described: &ParametricModel) -> Vec<f64> {
        described.base().values(&self.parameters())
    }
}

/// The described robot: the tip's mass and the friction are unknown.
pub(crate) fn described() -> ParametricModel {
    ParametricModel::new(arm(1.0, 1.0), friction(CoulombShape::Smooth { width: 0.1 })).unwrap()
}

/// Sums of sines that start and end at rest, 20 s.
pub(crate) fn reference() -> Reference {
    let samples = (20.0 * RATE_HZ) as usize;
    let mut motion = Motion { samples, joints: 2, ..Motion::default() };
    for (amplitude, first) in [(0.6, 0.1), (0.8, 0.15)] {
        for sample in 0..samples {
            let t = sample as f64 / RATE_HZ;
            let term = |share: f64, hertz: f64| {
                let (a, w) = (share * amplitude, core::f64::consts::TAU * hertz);
                [a * (1.0 - (w * t).cos()), a * w * (w * t).sin(), a * w * w * (w * t).cos()]
            };
            let sum = |k: usize| {
                [term(0.6, first), term(-0.5, 2.0 * first), term(0.35, 4.0 * first)].iter().map(|own| own[k]).sum()
            };
            motion.q.push(sum(0));
            motion.dq.push(sum(1));
            motion.ddq.push(sum(2));
        }
    }
    Reference::new(RATE_HZ, motion).unwrap()
}

/// The joints move one after the other: joint 2 makes two strokes back and forth while joint 1 rests, then the reverse;
/// 24 s.
pub(crate) fn strokes_in_turn() -> Reference {
    let samples = (24.0 * RATE_HZ) as usize;
    let mut motion = Motion { samples, joints: 2, ..Motion::default() };
    // A quintic of 3 s from rest to rest, as position, velocity and acceleration relative to the distance.
    let quintic = |t: f64| {
        let (s, per_s) = ((t / 3.0).clamp(0.0, 1.0), 1.0 / 3.0_f64);
        [
            s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s),
            per_s * 30.0 * s * s * (1.0 - s).powi(2),
            per_s * per_s * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
        ]
    };
    for (begin_s, way) in [(12.0, 1.4), (0.0, 1.8)] {
        for sample in 0..samples {
            let t = sample as f64 / RATE_HZ - begin_s;
            let starts = [(0.0, way), (3.0, -way), (6.0, 0.5 * way), (9.0, -0.5 * way)];
            let sum = |k: usize| starts.iter().map(|(start, way)| way * quintic(t - start)[k]).sum();
            motion.q.push(sum(0));
            motion.dq.push(sum(1));
            motion.ddq.push(sum(2));
        }
    }
    Reference::new(RATE_HZ, motion).unwrap()
}

pub(crate) fn task() -> IterationTask {
    IterationTask::new(described(), reference()).unwrap()
}

/// The first run with the nominal model, then the finite-time law; the deviation smoothed, torque and columns with the
/// same filter.
pub(crate) fn settings() -> IterationSettings {
    let mut settings = IterationSettings {
        start: StartWith::Prior,
        first: Some(pd_gravity()),
        model_free: ControllerSettings::JointPd(JointPdSettings { kp: 600.0.into(), kd: 80.0.into() }),
        controller: ControllerSettings::FiniteTime(FiniteTimeSettings::with_gains(100.0, 20.0)),
        max_runs: 6,
        ..IterationSettings::default()
    };
    settings.identification.differentiator = toml::from_str::<DifferentiatorSettings>(
        "method = \"deviation\"\nsmoother = { method = \"butterworth\", cutoff_hz = 6.0 }",
    )
    .unwrap();
    settings.identification.parallel_filter =
        Some(DecimationSettings { factor: 25, cutoff_hz: Some(6.0), ..DecimationSettings::default() });
    settings.settled.tracking_tolerance = 1e-3;
    settings
}

fn pd_gravity() -> ControllerSettings {
    toml::from_str("kind = \"pd-gravity\"\nkp = 1200.0\nkd = 120.0").unwrap()
}

pub(crate) fn iterated(simulated: &Simulated, settings: IterationSettings) -> (Iteration, IterationOutcome) {
    let iteration = Iteration::new(task(), settings).unwrap();
    let outcome = iterate(&iteration, &mut [&mut simulated.robot()], None, &mut |_, _| {}).unwrap();
    (iteration, outcome)
}
