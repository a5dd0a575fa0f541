//! Rehearsal: simulation of a motion before it is commanded. It evaluates the torque of the motion, the mass matrix
//! of the controller's model, and the closed loop with simulated robots that deviate from the model.

use crate::robot::{Breach, Envelope, JointOscillation, RunOscillations};
use crate::setup::posture::{at_sample, inertia_matrix};
use crate::signals::dry_steps::with_dry_steps;
use crate::signals::oscillation::OscillationLimits;
use crate::signals::rests::highest_speeds;
use dynident_dynamics::ParametricModel;
use dynident_model::sample::Random;
use dynident_model::{InertialParameters, Model};
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{
    LimitedQuantity, LoopSettings, Plant, Reference, RunLimits, RunStatus, SimulationError, closed_loop, require,
};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use thiserror::Error;

/// Smallest accepted eigenvalue of the mass matrix relative to the largest; a smaller one is only rounding.
const MIN_EIGENVALUE_RATIO: f64 = 1e-12;
/// Default delay of a controller whose delay is unknown, s, for an arm of 1.2 m.
const DELAY_S: f64 = 0.008;
/// Default of the smallest inertia of a drive that the robot description does not contain, as a share of the typical
/// inertia. A gripper with 30 Nm in its robot description had 0.01 kg m² instead of the typical 0.1.
const LIGHTEST_DRIVE: f64 = 0.1;
/// Largest accepted delay in the settings, s.
const MAX_DELAY_S: f64 = 10.0;

/// Settings of the rehearsal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RehearsalSettings {
    /// Largest deviation of the simulated robots from the model, percent: each body and each parameter of friction
    /// and drives varies by this percentage. Default 30.
    pub uncertainty_percent: f64,
    /// Number of simulated robots that deviate from the model, in addition to the model itself. Default 4.
    pub robots: usize,
    /// Delay of the robot's controller between its sensors and its drives, seconds. Derived gains tolerate this
    /// delay, and robots are simulated with it. Not used for a position loop in the drives. Default 8 ms for an arm
    /// of 1.2 m (some control cycles over a network), multiplied by the characteristic time of other arms. In a study
    /// the default is 0 if the gains are given or the robot waits for every torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Smallest inertia of a drive that the robot description does not contain, as a share of the typical inertia
    /// (which the effort limit accelerates by 300 rad/s² for an arm of 1.2 m). Derived gains keep a joint stable down
    /// to this inertia, and a robot with such drives is simulated. Default 0.1; in a study 1 if the gains are given,
    /// because the robot has probably run with them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lightest_drive: Option<f64>,
    /// Number of postures along the motion at which the mass matrix is checked; as many postures are checked in the
    /// workspace. Default 200.
    pub postures: usize,
    /// Seed of the random robots and postures. Default 1.
    pub seed: u64,
}

impl Default for RehearsalSettings {
    fn default() -> Self {
        Self { uncertainty_percent: 30.0, robots: 4, delay_s: None, lightest_drive: None, postures: 200, seed: 1 }
    }
}

impl RehearsalSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let percent = self.uncertainty_percent;
        require((0.0..=90.0).contains(&percent), "rehearsal.uncertainty_percent", percent, "give 0 to 90")?;
        let delay_s = self.delay_s.unwrap_or(0.0);
        require((0.0..=MAX_DELAY_S).contains(&delay_s), "rehearsal.delay_s", delay_s, "give 0 to 10 s")?;
        let lightest = self.lightest_drive();
        require((0.001..=1.0).contains(&lightest), "rehearsal.lightest_drive", lightest, "give 0.001 to 1")?;
        require(self.robots <= 1000, "rehearsal.robots", self.robots as f64, "give at most 1000")?;
        require(self.postures <= 1_000_000, "rehearsal.postures", self.postures as f64, "give at most 1000000")
    }

    /// Smallest inertia of a drive that the robot description does not contain, as a share of the typical inertia.
    pub fn lightest_drive(&self) -> f64 {
        self.lightest_drive.unwrap_or(LIGHTEST_DRIVE)
    }

    /// Largest delay of the controller of this robot, s.
    pub fn delay_s(&self, model: &Model) -> f64 {
        self.delay_s.unwrap_or_else(|| model.characteristic_scale().seconds(DELAY_S))
    }
}

/// Result of a rehearsal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Rehearsal {
    /// Smallest eigenvalue of the model's mass matrix over all postures, kg m² (kg).
    pub smallest_eigenvalue: f64,
    /// Largest torque of the model for each joint along the motion, Nm (N).
    pub largest_torque: Vec<f64>,
    /// Largest distance of each joint from the path over all simulated robots, rad (m).
    pub largest_tracking_error_rad: Vec<f64>,
}

/// Why a motion is not commanded.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RehearsalFailure {
    /// The commanded motion itself exceeds a limit of position, velocity or workspace, so Dynident does not run it on
    /// the robot.
    #[error("the motion leaves the envelope: {breach}; use another motion, or correct the limit in [iteration.envelope]", breach = .0)]
    Path(Breach),
    /// The inertias of the model are not physically consistent. Run `dynident inspect ROBOT --fix OUT.urdf`, or correct
    /// them in the robot description.
    #[error(
        "the model's mass matrix is not positive definite (eigenvalue {eigenvalue:.3e} kg m^2) at the positions {q:.3?}: a controller with this model may push in the wrong direction"
    )]
    MassMatrix {
        /// Smallest eigenvalue.
        eigenvalue: f64,
        /// Positions of the joints, rad (m).
        q: Vec<f64>,
    },
    /// The motion needs more torque than `[iteration.envelope]` permits. Reduce the velocity or acceleration limits
    /// under `[design.limits]`.
    #[error("the model's torque along the motion leaves the envelope: {breach}; use a slower motion", breach = .0)]
    Torque(Breach),
    /// The command was stopped, for example by Ctrl-C, during the rehearsal. Run it again.
    #[error("the rehearsal was interrupted")]
    Interrupted,
    /// A simulated robot with other masses and friction, within `uncertainty_percent`, stops early with these gains.
    /// The real robot could do so, too.
    #[error(
        "in simulation, {robot} does not follow the motion: {verdict}; {advice}use other gains (kp, kd, or bandwidth_hz), compensate gravity (start = \"prior\"), or change rehearsal.uncertainty_percent or [iteration.envelope]",
        advice = room_words(.verdict)
    )]
    Loop {
        /// Name of the simulated robot.
        robot: String,
        /// How its simulation ended.
        verdict: RunStatus,
    },
    /// With these gains, the simulated robot vibrates: the gains are too high for the sampling rate or the delay. Lower
    /// `kp` and `kd`, or `bandwidth_hz`.
    #[error("in simulation, {robot} oscillates: {oscillation}")]
    Oscillates {
        /// Name of the simulated robot.
        robot: String,
        /// The oscillation.
        oscillation: JointOscillation,
    },
    /// A simulated robot with other masses and friction leaves the workspace, because its tracking error is too large.
    /// The real robot could do so, too.
    #[error("in simulation, {robot} leaves the envelope: {breach}; keep the motion further inside, or use other gains")]
    Outside {
        /// Name of the simulated robot.
        robot: String,
        /// The violated limit.
        breach: Breach,
    },
}

/// Text for a motion that reaches a limit exactly: no gains can keep the tracking error within this limit.
fn room_words(verdict: &RunStatus) -> &'static str {
    match verdict {
        RunStatus::LimitBroken { quantity: LimitedQuantity::Position, .. } => {
            "keep the motion further from the limits of position ([design.defaults] stop_margin_percent, or position in [design.limits]), "
        }
        RunStatus::LimitBroken { quantity: LimitedQuantity::Speed, .. } => {
            "keep the motion further below the limits of velocity (speed in [design.limits]), "
        }
        RunStatus::LimitBroken { quantity: LimitedQuantity::TrackingError, .. }
        | RunStatus::Diverged { .. }
        | RunStatus::Done => "",
    }
}

#[derive(Clone, Copy)]
struct Rehearsing {
    /// 0 for the model itself, otherwise the number of the deviating robot.
    number: usize,
    delay_s: f64,
    /// Whether the drives of the robot have the smallest inertia.
    is_light: bool,
}

impl Rehearsing {
    /// Largest simulated delay in samples.
    const MAX_DELAY_SAMPLES: f64 = 1000.0;

    fn delay_samples(self, rate_hz: f64) -> usize {
        (self.delay_s * rate_hz).round().min(Self::MAX_DELAY_SAMPLES) as usize
    }

    fn words(self, settings: &RehearsalSettings) -> String {
        let percent = settings.uncertainty_percent;
        let robot = match self.number {
            _ if self.is_light => format!(
                "the model with {} of the typical inertia of drives (rehearsal.lightest_drive)",
                settings.lightest_drive()
            ),
            0 => "the model".to_owned(),
            number => format!("a robot up to {percent} % off the model ({number} of {})", settings.robots),
        };
        match self.delay_s {
            0.0 => robot,
            late => format!("{robot}, with {:.3} ms of controller delay (rehearsal.delay_s),", 1e3 * late),
        }
    }
}

pub(crate) struct Rehearsed<'a> {
    pub(crate) robot: &'a ParametricModel,
    /// The complete commanded trajectories, including the paths from and to the home posture.
    pub(crate) references: &'a [Cow<'a, Reference>],
    pub(crate) controller: &'a ControllerSettings,
    pub(crate) model: Option<&'a ControllerModel>,
    /// All parameters of the simulated robot, if known.
    pub(crate) believed: Option<&'a [f64]>,
    /// All parameters with the smallest drive inertia; `None` if all drive inertias are known.
    pub(crate) light: Option<&'a [f64]>,
    pub(crate) oscillation: Option<OscillationLimits>,
    pub(crate) envelope: Option<&'a Envelope>,
}

impl Rehearsed<'_> {
    /// Rehearses the motion; ends early when `stop` returns true.
    ///
    /// # Errors
    /// Invalid numbers; a failed rehearsal is part of the result.
    pub(crate) fn run(
        &self,
        settings: &RehearsalSettings,
        stop: &dyn Fn() -> bool,
    ) -> Result<Result<Rehearsal, RehearsalFailure>, SimulationError> {
        let dof = self.robot.dof();
        let names = self.robot.joint_names();
        let mut shown = Rehearsal {
            smallest_eigenvalue: f64::INFINITY,
            largest_torque: vec![0.0; dof],
            largest_tracking_error_rad: vec![0.0; dof],
        };
        let path = self.references.iter().find_map(|reference| self.envelope?.broken_by(reference, &names));
        if let Some(breach) = path {
            return Ok(Err(RehearsalFailure::Path(breach)));
        }
        let (model, terms) = (self.robot.model(), self.robot.terms());
        let own = self.believed.map(|all| ControllerModel::from_parameters(model, terms, all)).transpose()?;
        let Some(mut known) = self.model.cloned().or(own) else { return Ok(Ok(shown)) };
        let mut random = Random::new(settings.seed);
        for q in self.postures(settings.postures, &mut random) {
            if stop() {
                return Ok(Err(RehearsalFailure::Interrupted));
            }
            let eigenvalues = inertia_matrix(&mut known, &q).symmetric_eigenvalues();
            let (smallest, largest) = (eigenvalues.min(), eigenvalues.max());
            if smallest.is_nan() || smallest <= MIN_EIGENVALUE_RATIO * largest.abs() {
                return Ok(Err(RehearsalFailure::MassMatrix { eigenvalue: smallest, q }));
            }
            shown.smallest_eigenvalue = shown.smallest_eigenvalue.min(smallest);
        }
        let mut tau = vec![0.0; dof];
        for reference in self.references {
            for sample in 0..reference.samples() {
                let [q, dq, ddq] = at_sample(reference, sample);
                known.reference_torque(&q, &dq, &ddq, &mut tau);
                let time_s = sample as f64 / reference.rate_hz();
                if let Some(breach) = self.envelope.and_then(|own| own.torque_breach(&tau, &names, time_s)) {
                    return Ok(Err(RehearsalFailure::Torque(breach)));
                }
                shown.largest_torque.iter_mut().zip(&tau).for_each(|(most, tau)| *most = most.max(tau.abs()));
            }
        }
        if let Some(believed) = self.believed.filter(|_| self.controller.can_be_simulated()) {
            let in_drives = matches!(self.controller, ControllerSettings::PositionLoop(_));
            let delay_s = if in_drives { 0.0 } else { settings.delay_s(self.robot.model()) };
            let late = (0..=settings.robots).map(|number| Rehearsing { number, delay_s, is_light: false });
            let itself = Rehearsing { number: 0, delay_s: 0.0, is_light: false };
            for one in core::iter::once(itself).chain(late.skip(usize::from(delay_s == 0.0))) {
                if stop() {
                    return Ok(Err(RehearsalFailure::Interrupted));
                }
                if let Err(failure) = self.simulate(believed, one, settings, &mut random, &mut shown)? {
                    return Ok(Err(failure));
                }
            }
            // Simulated without a delay, because the gains already allow for it. This detects joints that are too
            // fast for the controller's rate.
            if let Some(light) = self.light {
                let one = Rehearsing { is_light: true, ..itself };
                if let Err(failure) = self.simulate(light, one, settings, &mut random, &mut shown)? {
                    return Ok(Err(failure));
                }
            }
        }
        Ok(Ok(shown))
    }

    fn simulate(
        &self,
        believed: &[f64],
        one: Rehearsing,
        settings: &RehearsalSettings,
        random: &mut Random,
        shown: &mut Rehearsal,
    ) -> Result<Result<(), RehearsalFailure>, SimulationError> {
        let model = self.robot.model();
        let (of_bodies, of_terms) = believed.split_at(model.inertial_count());
        let off = if one.number == 0 { 0.0 } else { 0.01 * settings.uncertainty_percent };
        let mut factor = || if random.bits() & 1 == 0 { 1.0 + off } else { 1.0 - off };
        let bodies: Vec<InertialParameters> = of_bodies
            .chunks_exact(10)
            .map(|own| {
                let factor = factor();
                InertialParameters(core::array::from_fn(|k| factor * own[k]))
            })
            .collect();
        let terms: Vec<f64> = of_terms.iter().map(|value| factor() * value).collect();
        let fastest = highest_speeds(self.references.iter().map(|reference| &**reference));
        let laws = with_dry_steps(self.robot.terms(), &fastest);
        let mut plant = Plant::new(&model.with_inertials(&bodies)?, &laws, &terms)?;
        let mut limits = RunLimits::default();
        if let Some(envelope) = self.envelope {
            envelope.limit(&mut limits);
        }
        let mut looped = LoopSettings { limits, ..LoopSettings::default() };
        for reference in self.references {
            looped.sensors.feedback_delay_samples = one.delay_samples(reference.rate_hz());
            let mut controller = self.controller.build(model.dof(), self.model)?;
            let run = closed_loop(&mut plant, controller.as_mut(), reference, &looped)?;
            let largest = shown.largest_tracking_error_rad.iter_mut().zip(&run.max_error);
            largest.for_each(|(most, error)| *most = most.max(*error));
            let outside = self.envelope.and_then(|envelope| envelope.outside(&run.q, run.samples, run.rate_hz));
            let names = &run.joints;
            let found = RunOscillations::first(self.oscillation, reference, &run.q, run.samples, names);
            if let Some(oscillation) = found {
                return Ok(Err(RehearsalFailure::Oscillates { robot: one.words(settings), oscillation }));
            }
            if !run.status.is_done() || outside.is_some() {
                let robot = one.words(settings);
                return Ok(Err(match outside.filter(|_| run.status.is_done()) {
                    Some(breach) => RehearsalFailure::Outside { robot, breach },
                    None => RehearsalFailure::Loop { robot, verdict: run.status },
                }));
            }
        }
        Ok(Ok(()))
    }

    /// Random postures in the workspace (within the envelope, or half a turn (1 m) to either side), and postures
    /// along the motions.
    fn postures(&self, count: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let joints = self.robot.model().joints();
        let mut range = |joint: usize| {
            let most = if joints[joint].is_rotary() { core::f64::consts::PI } else { 1.0 };
            let lower = self.envelope.and_then(|own| own.lower[joint]).unwrap_or(-most);
            let upper = self.envelope.and_then(|own| own.upper[joint]).unwrap_or(most);
            random.uniform(lower, upper.max(lower))
        };
        let mut postures: Vec<Vec<f64>> = (0..count).map(|_| (0..joints.len()).map(&mut range).collect()).collect();
        for reference in self.references {
            let step = (reference.samples() / count.max(1)).max(1);
            let along = (0..reference.samples()).step_by(step);
            postures.extend(along.map(|sample| at_sample(reference, sample)).map(|[q, ..]| q));
        }
        postures
    }
}
