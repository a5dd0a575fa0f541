//! Simulated logs of robots with one event each, and logs with unusual but normal content.

mod disturbances;
mod paths;

use disturbances::{fill_holes, loaded, overflow};
use dynident_dynamics::{Workspace, inverse_dynamics};
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Model};
use paths::{differences, excitation, halted, path, rms, stopped};

/// Sampling rate.
pub const RATE_HZ: f64 = 200.0;
/// Duration of a log.
pub const DURATION_S: f64 = 24.0;

/// What happens in a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scene {
    /// The brakes close without drives for some seconds.
    DrivesOff,
    /// The same to the end of the log.
    EmergencyStop,
    /// A force on the last link for 0.4 s.
    Collision,
    /// A force on a link in the middle for 0.8 s.
    Push,
    /// A force on the last link for 6 s.
    HandGuiding,
    /// A joint meets a stop.
    JointStop,
    /// Another load to the end of the log.
    LoadChange,
    /// Another torque offset of joint 2 to the end of the log.
    OffsetChange,
    /// A slow change of the torque offset of joint 2.
    Drift,
    /// Friction that decreases slowly.
    WarmUp,
    /// Holes that were filled by straight lines.
    FilledHoles,
    /// The torque of joint 2 wraps.
    Overflow,
    /// No event.
    Normal(Style),
}

/// All events.
pub const EVENTS: [Scene; 12] = [
    Scene::DrivesOff,
    Scene::EmergencyStop,
    Scene::Collision,
    Scene::Push,
    Scene::HandGuiding,
    Scene::JointStop,
    Scene::LoadChange,
    Scene::OffsetChange,
    Scene::Drift,
    Scene::WarmUp,
    Scene::FilledHoles,
    Scene::Overflow,
];

/// Content of a log without event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Five harmonics.
    Excitation,
    /// The same, 2.5 times as fast.
    FastReversals,
    /// The same with two rests.
    Rests,
    /// Point-to-point motion with rests.
    PickAndPlace,
    /// Friction that grows with the torque.
    LoadFriction,
    /// Fast point-to-point motion.
    FastMotion,
    /// Encoder steps of 4e-4 rad.
    CoarseEncoders,
    /// A heavier tool during the whole log.
    OtherTool,
    /// A slow first half and a fast second half.
    SlowThenFast,
    /// Twice the dry friction near zero velocity.
    SharpStribeck,
    /// Dry friction that follows the path over the first 0.02 rad after a reversal.
    FrictionWithMemory,
    /// Pick and place with rests in which any share of the dry friction holds a joint.
    Stiction,
    /// Pick and place between the same four points. A joint at rest keeps the dry friction of its last motion.
    RepeatedProgram,
}

/// All styles.
pub const STYLES: [Style; 13] = [
    Style::Excitation,
    Style::FastReversals,
    Style::Rests,
    Style::PickAndPlace,
    Style::LoadFriction,
    Style::FastMotion,
    Style::CoarseEncoders,
    Style::OtherTool,
    Style::SlowThenFast,
    Style::SharpStribeck,
    Style::FrictionWithMemory,
    Style::Stiction,
    Style::RepeatedProgram,
];

/// A simulated log.
#[derive(Clone, Debug, Default)]
pub struct Simulated {
    /// Positions, by joint.
    pub q: Vec<Vec<f64>>,
    /// Torques, by joint.
    pub tau: Vec<Vec<f64>>,
    /// True start and end of each event, s.
    pub intervals: Vec<[f64; 2]>,
}

/// The true robot of a seed: other masses than in the description, and friction.
#[derive(Debug)]
pub struct Truth {
    model: Model,
    friction: Vec<[f64; 4]>,
    noise: Vec<f64>,
    scale: Vec<f64>,
    /// Centre and range of the motion.
    home: Vec<f64>,
    reach: Vec<f64>,
}

type Path = Vec<Vec<f64>>;

impl Truth {
    /// A robot near the description; the seed selects masses, friction and range of motion.
    ///
    /// # Panics
    /// If a scaled body is invalid.
    pub fn new(description: &Model, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut factor = || 1.0 + 0.2 * random.uniform(-1.0, 1.0);
        let changed = |body: &InertialParameters| {
            let factor = factor();
            InertialParameters(body.0.map(|parameter| factor * parameter))
        };
        let inertials: Vec<InertialParameters> = description.inertials().iter().map(changed).collect();
        let model = description.with_inertials(&inertials).expect("scaled bodies are valid");
        let dof = model.dof();
        let home = (0..dof).map(|_| random.uniform(-0.6, 0.6)).collect();
        let reach = (0..dof).map(|_| random.uniform(0.7, 1.2)).collect();
        let mut truth =
            Self { model, friction: vec![[0.0; 4]; dof], noise: vec![0.0; dof], scale: vec![1.0; dof], home, reach };
        let path = excitation(&truth, 1.0, &mut Random::new(seed ^ 0x55));
        let rigid = Self::rigid(&path, &truth.model);
        truth.scale = rigid.iter().map(|tau| rms(tau)).collect();
        let largest = truth.scale.iter().copied().fold(0.0, f64::max);
        for joint in 0..dof {
            let size = truth.scale[joint].max(0.03 * largest);
            truth.scale[joint] = size;
            truth.friction[joint] = [
                size * random.uniform(0.08, 0.25),
                size * random.uniform(0.08, 0.25),
                random.uniform(0.0, 0.4),
                random.uniform(0.05, 0.15),
            ];
            truth.noise[joint] = 0.012 * size;
        }
        truth
    }

    fn rigid(path: &Path, model: &Model) -> Path {
        let (dof, samples) = (path.len(), path[0].len());
        let mut workspace = Workspace::new(model);
        let velocity: Path = path.iter().map(|q| differences(q)).collect();
        let acceleration: Path = velocity.iter().map(|dq| differences(dq)).collect();
        let mut tau = vec![Vec::with_capacity(samples); dof];
        let at = |values: &Path, k: usize| -> Vec<f64> { values.iter().map(|joint| joint[k]).collect() };
        for k in 0..samples {
            let found = inverse_dynamics(model, &mut workspace, &at(path, k), &at(&velocity, k), &at(&acceleration, k));
            tau.iter_mut().zip(found).for_each(|(tau, value)| tau.push(*value));
        }
        tau
    }

    /// Simulates one log.
    pub fn log(&self, scene: Scene, seed: u64) -> Simulated {
        self.simulated(scene, seed, true)
    }

    /// The same motion and noise without the event.
    pub fn log_without_event(&self, scene: Scene, seed: u64) -> Simulated {
        self.simulated(scene, seed, false)
    }

    fn simulated(&self, scene: Scene, seed: u64, has_event: bool) -> Simulated {
        let mut random = Random::new(seed);
        let style = if let Scene::Normal(style) = scene { style } else { Style::Excitation };
        let mut path = path(self, style, &mut random);
        let mut out = Simulated::default();
        let samples = path[0].len();
        let time = |k: usize| k as f64 / RATE_HZ;
        let start_s = random.uniform(6.0, 12.0);
        let last_s = time(samples - 1);
        let mut stop = None;
        match scene {
            Scene::DrivesOff => {
                let end_s = start_s + random.uniform(2.0, 4.0);
                path = halted(&path, start_s, end_s);
                out.intervals.push([start_s, end_s]);
            }
            Scene::EmergencyStop => {
                let start_s = start_s + 4.0;
                path = halted(&path, start_s, last_s + 10.0);
                out.intervals.push([start_s, last_s]);
            }
            Scene::JointStop => {
                let joint = usize::from(random.uniform(0.0, 1.0) < 0.5) + 1;
                let (clipped, over, interval) = stopped(&path[joint]);
                stop = Some((joint, over));
                path[joint] = clipped;
                out.intervals.push(interval);
            }
            _ => {}
        }
        let mut model = self.model.clone();
        if style == Style::OtherTool {
            model = loaded(&model, 3.0 * self.size());
        }
        let mut tau = Self::rigid(&path, &model);
        self.add_friction(&path, &mut tau, scene, has_event, &mut Random::new(seed ^ 0xf));
        let mut with_event = tau.clone();
        self.add_event(scene, &path, &mut with_event, start_s, &mut out, &mut random);
        if has_event {
            tau = with_event;
        }
        if let Some((joint, over)) = stop.filter(|_| has_event) {
            let stiffness = 0.8 * self.scale[joint] / over.iter().copied().fold(0.0, f64::max);
            tau[joint].iter_mut().zip(&over).for_each(|(tau, over)| *tau += stiffness * over);
        }
        for joint in 0..path.len() {
            let mut noise = 0.0;
            for tau in &mut tau[joint] {
                noise = 0.5 * noise + 0.86 * self.noise[joint] * random.normal();
                *tau += noise;
            }
        }
        let step = if style == Style::CoarseEncoders { 4e-4 } else { 2e-5 };
        for q in path.iter_mut().flatten() {
            *q = ((*q + 0.3 * step * random.normal()) / step).round() * step;
        }
        (out.q, out.tau) = (path, tau);
        match scene {
            _ if !has_event => {}
            Scene::FilledHoles => fill_holes(&mut out, &mut random),
            Scene::Overflow => overflow(&mut out),
            _ => {}
        }
        out
    }

    /// Mass scale of the robot: 1 for a UR10.
    fn size(&self) -> f64 {
        self.model.inertials().iter().map(InertialParameters::mass_kg).sum::<f64>() / 28.0
    }

    fn add_friction(&self, path: &Path, tau: &mut Path, scene: Scene, has_event: bool, random: &mut Random) {
        for joint in 0..path.len() {
            let [dry, viscous, stribeck, ripple] = self.friction[joint];
            let stribeck = if scene == Scene::Normal(Style::SharpStribeck) { 1.0 } else { stribeck };
            let load = if scene == Scene::Normal(Style::LoadFriction) { 0.15 } else { 0.01 };
            let velocity = differences(&path[joint]);
            let reach_rad = if scene == Scene::Normal(Style::RepeatedProgram) { 3e-4 } else { 0.02 };
            let (mut bristle, mut held) = (Bristle { reach_rad, direction: 0.0 }, Held::default());
            for (k, dq) in velocity.iter().enumerate() {
                let cold =
                    if scene == Scene::WarmUp && has_event { 1.0 + (-(k as f64) / RATE_HZ / 8.0).exp() } else { 1.0 };
                let dry = dry * (1.0 + stribeck * (-(dq / 0.08).powi(2)).exp()) + load * tau[joint][k].abs();
                let ripple = 0.05 * ripple * self.scale[joint] * (40.0 * path[joint][k]).sin();
                let direction = match scene {
                    Scene::Normal(Style::FrictionWithMemory | Style::RepeatedProgram) => bristle.next(*dq),
                    Scene::Normal(Style::Stiction) => held.next(*dq, random),
                    _ => (dq / 0.008).tanh(),
                };
                tau[joint][k] += cold * (dry * direction + viscous * dq) + ripple;
            }
        }
    }
}

/// Friction relative to its dry value with the memory of an elastic contact (Dahl).
struct Bristle {
    /// Distance after a reversal that reverses the friction.
    reach_rad: f64,
    direction: f64,
}

impl Bristle {
    fn next(&mut self, dq: f64) -> f64 {
        self.direction += dq / RATE_HZ / self.reach_rad * 3.0 * (1.0 - self.direction * dq.signum());
        self.direction = self.direction.clamp(-1.0, 1.0);
        self.direction
    }
}

/// Friction relative to its dry value that keeps a random value while the joint rests.
#[derive(Default)]
struct Held(Option<f64>);

impl Held {
    fn next(&mut self, dq: f64, random: &mut Random) -> f64 {
        if dq.abs() > 0.004 {
            self.0 = None;
            return (dq / 0.008).tanh();
        }
        *self.0.get_or_insert_with(|| random.uniform(-1.0, 1.0))
    }
}
