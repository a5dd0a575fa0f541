//! A motion is rehearsed before it is commanded: its torque, the mass matrix of the controller's model, and the closed
//! loop in simulation with robots that are not quite the model.

use crate::dry_steps::with_dry_steps;
use crate::oscillation::OscillationLimits;
use crate::posture::{at_sample, inertia_matrix};
use crate::rests::highest_speeds;
use crate::robot::{Breach, Envelope, JointOscillation, RunOscillations};
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

/// A smaller share of the largest eigenvalue counts as none: rounding alone makes it.
const SINGULAR: f64 = 1e-12;
/// Delay of a controller of which nothing is known, seconds of a usual arm.
const DELAY_S: f64 = 0.008;
/// Share of the typical inertia of a drive of which nothing is known: a gripper whose description states 30 Nm had
/// 0.01 kg m² of 0.1.
const LIGHTEST_DRIVE: f64 = 0.1;
/// Longest delay that can be stated, s.
const MOST_DELAY_S: f64 = 10.0;

/// How a motion is rehearsed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RehearsalSettings {
    /// How far the true robot may be from the model: every mass and every parameter of friction and drives by so many
    /// percent up or down. Default 30.
    pub uncertainty_percent: f64,
    /// Robots within that which are simulated beside the model itself. Default 4.
    pub robots: usize,
    /// How late the robot's controller may see or act, between its sensors and its drives, seconds: gains that are
    /// derived bear it, and the robots are simulated with it. That of a loop that runs in the drives is theirs. Default
    /// 8 ms of an arm of 1.2 m, of others as much in their own seconds: some cycles of control over a network. In a
    /// study by default none where the gains are stated, or the robot waits for every torque.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// Least inertia of a drive without a described inertia, as a share of the typical one (which the effort limit
    /// accelerates by 300 rad/s² of a usual arm): derived gains keep a joint stable down to it, and a robot with such
    /// drives is simulated. Default 0.1; in a study by default 1 where the gains are stated, because the robot is
    /// expected to have run with them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lightest_drive: Option<f64>,
    /// Postures at which the mass matrix is looked at: so many over the workspace, and so many along the motion.
    /// Default 200.
    pub postures: usize,
    /// Seed of robots and postures. Default 1.
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
        require((0.0..=MOST_DELAY_S).contains(&delay_s), "rehearsal.delay_s", delay_s, "give 0 to 10 s")?;
        let lightest = self.lightest_drive();
        require((0.001..=1.0).contains(&lightest), "rehearsal.lightest_drive", lightest, "give 0.001 to 1")?;
        require(self.robots <= 1000, "rehearsal.robots", self.robots as f64, "give at most 1000")?;
        require(self.postures <= 1_000_000, "rehearsal.postures", self.postures as f64, "give at most 1000000")
    }

    /// Least inertia of a drive of which nothing is known, as a share of the typical one.
    pub fn lightest_drive(&self) -> f64 {
        self.lightest_drive.unwrap_or(LIGHTEST_DRIVE)
    }

    /// How late a controller outside of such a robot may be, s.
    pub fn delay_s(&self, model: &Model) -> f64 {
        self.delay_s.unwrap_or_else(|| model.own_scale().seconds(DELAY_S))
    }
}

/// What a rehearsal has shown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Rehearsal {
    /// Smallest eigenvalue of the model's mass matrix over all postures, kg m² (kg).
    pub smallest_eigenvalue: f64,
    /// Per joint: the largest torque of the model along the motion, Nm (N).
    pub largest_torque: Vec<f64>,
    /// Per joint: the largest distance from the path of any simulated robot, rad (m).
    pub largest_tracking_error_rad: Vec<f64>,
}

/// Why a motion is not commanded.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RehearsalFailure {
    /// The motion itself leaves the envelope.
    #[error("the motion itself leaves the envelope: {0}; give another motion, or the limit in [iteration.envelope]")]
    Path(Breach),
    /// No body moves like that.
    #[error(
        "the model's mass matrix is not positive definite (eigenvalue {eigenvalue:.3e} kg m^2) at the positions {q:.3?}: a controller with it may push the wrong way"
    )]
    MassMatrix {
        /// The eigenvalue.
        eigenvalue: f64,
        /// Where, rad (m).
        q: Vec<f64>,
    },
    /// The motion asks for more than there is.
    #[error("the model's torque along the motion leaves the envelope: {0}; give a slower motion")]
    Torque(Breach),
    /// Somebody asked for a stop.
    #[error("the rehearsal was interrupted")]
    Interrupted,
    /// A robot that may be the true one is not held.
    #[error(
        "in simulation {robot} is not held: {verdict}; {}give other gains (kp, kd, or bandwidth_hz), compensate gravity (start = \"prior\"), or state rehearsal.uncertainty_percent and [iteration.envelope]",
        room_words(.verdict)
    )]
    Loop {
        /// Which robot.
        robot: String,
        /// How its run ended.
        verdict: RunStatus,
    },
    /// A robot that may be the true one is held, but oscillates.
    #[error("in simulation {robot} is not held: {oscillation}")]
    Oscillates {
        /// Which robot.
        robot: String,
        /// How.
        oscillation: JointOscillation,
    },
    /// A robot that may be the true one is held, but a link of it leaves the workspace.
    #[error("in simulation {robot} leaves the envelope: {breach}; keep the motion further inside, or give other gains")]
    Outside {
        /// Which robot.
        robot: String,
        /// How.
        breach: Breach,
    },
}

/// A motion that goes right up to a stop leaves no room for any tracking error: no gains mend that.
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

/// One robot of a rehearsal.
#[derive(Clone, Copy)]
struct Rehearsing {
    /// 0 for the model itself, or the number of one that differs.
    number: usize,
    /// How late its controller is.
    delay_s: f64,
    /// Whether its drives are as light as they may be.
    is_light: bool,
}

impl Rehearsing {
    /// Most samples of delay that a simulated loop has.
    const MOST_SAMPLES: f64 = 1000.0;

    fn delay_samples(self, rate_hz: f64) -> usize {
        (self.delay_s * rate_hz).round().min(Self::MOST_SAMPLES) as usize
    }

    fn words(self, settings: &RehearsalSettings) -> String {
        let percent = settings.uncertainty_percent;
        let robot = match self.number {
            _ if self.is_light => format!(
                "the model with {} of the typical inertia of drives (rehearsal.lightest_drive)",
                settings.lightest_drive()
            ),
            0 => "the model itself".to_owned(),
            number => format!("a robot up to {percent} % off the model ({number} of {})", settings.robots),
        };
        match self.delay_s {
            0.0 => robot,
            late => format!("{robot}, its controller {:.3} ms late (rehearsal.delay_s),", 1e3 * late),
        }
    }
}

/// What is rehearsed.
pub(crate) struct Rehearsed<'a> {
    pub(crate) robot: &'a ParametricModel,
    /// The whole of what is commanded, trajectory by trajectory: with the ways, where there are some.
    pub(crate) references: &'a [Cow<'a, Reference>],
    pub(crate) controller: &'a ControllerSettings,
    /// The controller's model.
    pub(crate) model: Option<&'a ControllerModel>,
    /// What is believed of the robot, all parameters: what is simulated.
    pub(crate) believed: Option<&'a [f64]>,
    /// The same with drives that are as light as they may be; none where all are known.
    pub(crate) light: Option<&'a [f64]>,
    /// Oscillation that would stop a run.
    pub(crate) oscillation: Option<OscillationLimits>,
    pub(crate) envelope: Option<&'a Envelope>,
}

impl Rehearsed<'_> {
    /// Rehearses, until `stop` says so.
    ///
    /// # Errors
    /// Numbers that do not fit; that the rehearsal fails is inside.
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
        // The mass matrix, where the robot may come to stand and where it moves.
        let mut random = Random::new(settings.seed);
        for q in self.postures(settings.postures, &mut random) {
            if stop() {
                return Ok(Err(RehearsalFailure::Interrupted));
            }
            let eigenvalues = inertia_matrix(&mut known, &q).symmetric_eigenvalues();
            let (smallest, largest) = (eigenvalues.min(), eigenvalues.max());
            if smallest.is_nan() || smallest <= SINGULAR * largest.abs() {
                return Ok(Err(RehearsalFailure::MassMatrix { eigenvalue: smallest, q }));
            }
            shown.smallest_eigenvalue = shown.smallest_eigenvalue.min(smallest);
        }
        // The torque along the motion.
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
        // The closed loop, as it should be and as late as it may be.
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
            // Without a delay: the gains allow for it already, and no joint may be too fast for the controller's rate.
            if let Some(light) = self.light {
                let one = Rehearsing { is_light: true, ..itself };
                if let Err(failure) = self.simulate(light, one, settings, &mut random, &mut shown)? {
                    return Ok(Err(failure));
                }
            }
        }
        Ok(Ok(shown))
    }

    /// One robot along all motions.
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

    /// Postures over the workspace (within the envelope, or a turn, or 1 m, to either side) and along the motions.
    fn postures(&self, count: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let joints = self.robot.model().joints();
        let mut range = |joint: usize| {
            let most = if joints[joint].turns() { core::f64::consts::PI } else { 1.0 };
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
