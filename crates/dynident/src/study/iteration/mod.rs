//! `[iteration]`: how a study's robot is run, identified and run again.

mod differentiator_key;
mod held_out;
mod legs;
mod motion;
mod safety;

pub use differentiator_key::{Automatic, DifferentiatorKey};
pub use held_out::HeldOutSection;
pub use legs::{LegOrder, LegSection};
pub use motion::MotionChoice;

use super::FrictionChoice;
use super::StartPosture;
use super::Study;
use super::design::name_or_table::name_or_table;
use crate::error::StudyError;
use dynident_identification::estimators::Estimator;
use dynident_identification::{IdentificationSettings, OffsetChoice};
use dynident_iteration::robot::{EnvelopeSettings, FolderSettings, ProcessSettings};
use dynident_iteration::{
    IterationSettings, OscillationSettings, RehearsalSettings, RunIdentificationSettings, RunOffsets, SafetySettings,
    Scheme, SettledSettings, StartWith, TorqueCheckSettings,
};
use dynident_recording::DecimationSettings;
use dynident_simulation::{ControllerSettings, PerJoint};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Which robot runs the trajectories.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum RobotChoice {
    /// The simulator, as `[simulation]` says.
    #[default]
    Simulation,
    /// Another program over the line protocol.
    Process(ProcessSettings),
    /// A person: files out, a log in.
    Folder(FolderSettings),
    /// A function of this process, which no file can name: [`iterate_with_robot`](crate::iterate_with_robot).
    #[serde(skip)]
    Function,
}

/// What is believed of the bodies before any run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PriorChoice {
    /// What the description says.
    #[default]
    Description,
    /// Nothing.
    None,
}

/// `[iteration]`, all of it optional.
///
/// ```
/// let section: dynident::study::IterationSection = toml::from_str(
///     r#"
///     scheme = "step-by-step"
///     prior = "none"
///     model_free = { kind = "joint-pd", kp = [100.0, 16.0], kd = [60.0, 8.0] }
///     max_runs = 6
///     differentiator = { method = "deviation", smoother = { method = "butterworth", cutoff_hz = 5.0 } }
///     settled = { tracking_tolerance = 1e-3 }
///     "#,
/// )?;
/// assert_eq!(section.max_runs, 6);
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
#[allow(clippy::struct_excessive_bools, reason = "keys of a file, each a choice of its own")]
pub struct IterationSection {
    /// A trajectory to run (`t_s, q1.., dq1.., ddq1..`), in place of the one that `[design]` leads to.
    pub trajectory: Option<PathBuf>,
    /// Whether every run repeats the first motion (`"repeat"`, the default), or each from the second on is designed
    /// with what is known (`"redesign"`). A name, or a table with a `kind` and its settings.
    #[serde(deserialize_with = "name_or_table")]
    #[cfg_attr(feature = "schema", schemars(transform = super::design::name_or_table::schema))]
    pub motion: MotionChoice,
    /// A motion that is run to judge the newest model and never fitted; none by default.
    pub held_out: Option<HeldOutSection>,
    /// Several trajectories, some with joints that are held, in place of one; each takes the study's trajectory or
    /// design unless it has its own.
    pub leg: Vec<LegSection>,
    /// Whether every run has all legs (`"together"`, the default), or each an iteration of its own, with what those
    /// before it have found held (`"one-after-another"`).
    pub order: LegOrder,
    /// Which robot runs it; the simulator by default.
    pub robot: RobotChoice,
    /// What is believed of the bodies before any run; what the description says by default.
    pub prior: PriorChoice,
    /// Under what the first run is: `"model-free"` (the default; `"prior"` with `bandwidth_hz`) or `"prior"`.
    pub start: Option<StartWith>,
    /// The controller of a first run with the prior, in place of `[controller]`.
    pub first: Option<ControllerSettings>,
    /// All joints at once, or step by step.
    pub scheme: Scheme,
    /// Every sample of every joint counts, also where a windowed design names windows; false by default.
    pub every_sample: bool,
    /// The paper's scheme as it stands: no physically consistent set is asked for, nothing is rejected and runs are not
    /// pooled. False by default.
    pub literal: bool,
    /// Whether the model is fitted to all good runs together, each weighted by its own noise; true by default.
    /// Otherwise to the newest alone.
    pub pool: bool,
    /// From positions to velocities and accelerations; `deviation` from the trajectory by default. With `"auto"` each
    /// run takes the way that leaves the least of its torques, the paper's map among them.
    pub differentiator: DifferentiatorKey,
    /// Low-pass and decimation of torque and regressor alike; none by default.
    pub parallel_filter: Option<DecimationSettings>,
    /// Whether recorded torques are held from sample to sample; true by default.
    pub held_torque: bool,
    /// The controller without a model; joint PD with 16 and 8 by default, of the simulator only: a robot outside has no
    /// default gains.
    pub model_free: Option<ControllerSettings>,
    /// Gains that are not stated come from the description's inertials, critically damped, with this natural frequency
    /// of each joint, Hz: for all joints one number, or a list.
    pub bandwidth_hz: Option<PerJoint>,
    /// What no sample of a run may leave: a run that does is stopped. Of a robot outside by default the description's
    /// limits with some room, and a distance from the path of 0.3 rad (0.1 m).
    pub envelope: EnvelopeSettings,
    /// How every motion of a robot outside is rehearsed before it is commanded.
    pub rehearsal: RehearsalSettings,
    /// Thresholds of oscillations: those that stop a run of a robot outside, and those that are reported for a log.
    pub oscillation: OscillationSettings,
    /// Samples a second of the robot's control loop and of what is handed over; `[simulation] rate_hz` (1000) by
    /// default.
    pub rate_hz: Option<f64>,
    /// Shares of its speed at which the motion is run before the first run, as `[0.1, 0.5, 1.0]`; none by default.
    pub speed_steps: Vec<f64>,
    /// Where the robot waits between runs, rad (m), all joints by name or in the model's order: every run goes from
    /// there to its motion and back, within the limits of `[design]`. Without it the robot has to stand where the
    /// motion begins.
    pub home: Option<StartPosture>,
    /// Share of the velocity and acceleration limits that the ways from home and back have; 0.2 by default.
    pub approach_speed: f64,
    /// How long the motion of a run is made over and over before the first run of a call, s, so that friction is at its
    /// working temperature; again where the robot has stood longer than this. 0 by default: not at all. Not of a robot
    /// behind a folder, which a person warms up.
    pub warm_up_s: f64,
    /// Tracking this many times worse than that of the last good run rejects a run.
    pub worse_factor: f64,
    /// How often a step is halved before the controller without a model comes back.
    pub most_halvings: usize,
    /// By how much its gains grow each time; 2 by default, and 1 (not at all) of a robot outside.
    pub stiffen: Option<f64>,
    /// Failed runs without a model before the robot counts as one that cannot follow.
    pub most_model_free: usize,
    /// Most runs.
    pub max_runs: usize,
    /// When all has settled.
    pub settled: SettledSettings,
    /// When a difference between logged and commanded torque counts.
    pub torque_check: TorqueCheckSettings,
}

impl Default for IterationSection {
    fn default() -> Self {
        let IterationSettings {
            identification,
            first,
            worse_factor,
            most_halvings,
            most_model_free,
            max_runs,
            settled,
            pool,
            ..
        } = IterationSettings::default();
        Self {
            trajectory: None,
            motion: MotionChoice::default(),
            held_out: None,
            leg: Vec::new(),
            order: LegOrder::default(),
            robot: RobotChoice::default(),
            prior: PriorChoice::default(),
            start: None,
            first,
            scheme: identification.scheme,
            every_sample: false,
            literal: false,
            pool,
            differentiator: DifferentiatorKey::Stated(identification.differentiator),
            parallel_filter: identification.parallel_filter,
            held_torque: identification.held_torque,
            model_free: None,
            bandwidth_hz: None,
            envelope: EnvelopeSettings::default(),
            rehearsal: RehearsalSettings::default(),
            oscillation: OscillationSettings::default(),
            speed_steps: Vec::new(),
            home: None,
            approach_speed: 0.2,
            warm_up_s: 0.0,
            rate_hz: None,
            worse_factor,
            most_halvings,
            stiffen: None,
            most_model_free,
            max_runs,
            settled,
            torque_check: TorqueCheckSettings::default(),
        }
    }
}

impl IterationSection {
    /// The settings of the iteration, with the study's `[controller]`; runs are identified as `identification` says,
    /// with the iteration's own differentiator and filter.
    ///
    /// # Errors
    /// What a run cannot be identified with.
    pub(crate) fn settings(
        &self,
        study: &Study,
        identification: IdentificationSettings,
    ) -> Result<IterationSettings, StudyError> {
        let default = IterationSettings::default();
        let (differentiator, choose_differentiator) = match &self.differentiator {
            DifferentiatorKey::Automatic(Automatic::Auto) => (default.identification.differentiator, true),
            DifferentiatorKey::Stated(stated) => (stated.clone(), false),
        };
        differentiator.validate().map_err(StudyError::at("iteration.differentiator"))?;
        let IdentificationSettings { mut estimation, consistency, mut friction, offsets, .. } = identification;
        let run_offsets = match offsets {
            OffsetChoice::Shared => RunOffsets::WhereSeen,
            OffsetChoice::PerLog => RunOffsets::PerRun,
        };
        // A controller is to have the friction that the study states, unless a key says otherwise.
        friction.retain(|search| study.drive.friction_of(&search.joint) == Some(FrictionChoice::Auto));
        if self.scheme == Scheme::StepByStep && !estimation.estimator.is_plain() {
            let key = format!("estimator.method = \"{}\"", estimation.estimator.name());
            return Err(StudyError::conflict(key, "scheme = \"step-by-step\" takes \"ordinary\" or \"weighted\""));
        }
        let in_turn =
            self.scheme == Scheme::StepByStep || self.order == LegOrder::OneAfterAnother && self.leg.len() > 1;
        if in_turn && !friction.is_empty() {
            let fix = "only runs that hold information about all joints at once can choose; state the friction, or take out scheme and order of [iteration]";
            return Err(StudyError::conflict("drive.friction = \"auto\"", fix));
        }
        // A run's estimate is made, not tested.
        (estimation.exogeneity_test, estimation.essential) = (None, None);
        estimation.examine_exogeneity = false;
        if let Estimator::Auto(_) = estimation.estimator {
            estimation.estimator = Estimator::Weighted;
        }
        Ok(IterationSettings {
            identification: RunIdentificationSettings {
                scheme: self.scheme,
                differentiator,
                choose_differentiator,
                parallel_filter: self.parallel_filter.clone(),
                held_torque: self.held_torque,
                set_aside_near_rest: !self.literal,
                estimation,
                friction,
                friction_before: Vec::new(),
                consistency: consistency.filter(|_| !self.literal),
                payloads: study.payloads(),
                run_offsets,
            },
            start: self.start.unwrap_or_default(),
            first: self.first.clone(),
            first_model: None,
            model_free: self.model_free.clone().unwrap_or(default.model_free),
            controller: study.controller.clone().unwrap_or(default.controller),
            reject: !self.literal,
            pool: self.pool && !self.literal,
            worse_factor: self.worse_factor,
            most_halvings: self.most_halvings,
            // Nobody's gains are raised who did not ask for it.
            stiffen: self.stiffen.unwrap_or(if self.is_outside() { 1.0 } else { default.stiffen }),
            most_model_free: self.most_model_free,
            max_runs: self.max_runs,
            settled: self.settled.clone(),
            torque_check: Some(self.torque_check.clone()),
            safety: SafetySettings::default(),
        })
    }
}
