//! `[iteration]`: repeated runs and identification of the study's robot.

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
    ConvergenceSettings, IterationSettings, OscillationSettings, RehearsalSettings, RunIdentificationSettings,
    RunOffsets, SafetySettings, Scheme, StartWith, TorqueCheckSettings,
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
    /// The simulator with the settings of `[simulation]`.
    #[default]
    Simulation,
    /// Another program that uses the line protocol.
    Process(ProcessSettings),
    /// A person with a folder: Dynident writes files and reads a log.
    Folder(FolderSettings),
    /// A function of the calling program: `iterate_with_robot`.
    #[serde(skip)]
    Function,
}

/// Prior knowledge of the bodies before the first run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PriorChoice {
    /// The inertials of the robot description.
    #[default]
    Description,
    /// No prior.
    None,
}

/// Section `[iteration]`; every key is optional.
///
/// ```
/// let section: dynident_study::IterationSection = toml::from_str(
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
#[allow(clippy::struct_excessive_bools, reason = "independent keys of a file")]
pub struct IterationSection {
    /// File of the trajectory to run (`t_s, q1.., dq1.., ddq1..`), instead of a trajectory from `[design]`.
    pub trajectory: Option<PathBuf>,
    /// Whether every run repeats the first motion (`"repeat"`, the default), or each later run is designed with the
    /// current estimate (`"redesign"`). The value is a name, or a table with a `kind` and its settings.
    #[serde(deserialize_with = "name_or_table")]
    #[cfg_attr(feature = "schema", schemars(transform = super::design::name_or_table::schema))]
    pub motion: MotionChoice,
    /// A motion that validates the newest model and is never used for a fit; none by default.
    pub held_out: Option<HeldOutSection>,
    /// Several trajectories (legs) instead of one, some with held joints. Each uses the study's trajectory or design
    /// unless it has its own.
    pub leg: Vec<LegSection>,
    /// Whether every run contains all trajectories (`"together"`, the default), or each trajectory has a separate
    /// iteration with the estimates of the earlier ones fixed (`"one-after-another"`).
    pub order: LegOrder,
    /// The robot that runs the trajectories; the simulator by default.
    pub robot: RobotChoice,
    /// Prior knowledge of the bodies before the first run; the robot description by default.
    pub prior: PriorChoice,
    /// Controller of the first run: `"model-free"` (the default; `"prior"` with `bandwidth_hz`) or `"prior"`.
    pub start: Option<StartWith>,
    /// Controller of the first run if it uses the prior model; by default `[controller]`.
    pub first: Option<ControllerSettings>,
    /// Identification scheme: all joints at once, or joint by joint.
    pub scheme: Scheme,
    /// Whether to use every sample of every joint, even if a step-wise design defines time windows; false by default.
    pub every_sample: bool,
    /// Whether to use the original scheme of *Iterative Identification of Robot Dynamic Parameters Based on Logistic
    /// Function*: no physically consistent fit, no rejected runs, each model from the newest run only. False by
    /// default.
    pub literal: bool,
    /// Whether the model is fitted to all accepted runs together, each weighted by its residual variance (true, the
    /// default), or to the newest run only.
    pub pool: bool,
    /// Method that computes velocities and accelerations from positions; by default `deviation` from the trajectory.
    /// With `"auto"` each run uses the method with the smallest torque residual. The candidates include the map from
    /// position along logistic functions.
    pub differentiator: DifferentiatorKey,
    /// Low-pass filter and decimation that are applied to torque and regressor; none by default.
    pub parallel_filter: Option<DecimationSettings>,
    /// Whether recorded torques are constant between samples (zero-order hold); true by default.
    pub held_torque: bool,
    /// The controller without a model; by default joint PD with the gains 16 and 8 in the simulator. A robot outside
    /// the simulator has no default gains.
    pub model_free: Option<ControllerSettings>,
    /// Natural frequency of each joint's loop, Hz, for gains that are not given. They are computed from the inertials
    /// of the robot description with critical damping. One number for all joints, or a list.
    pub bandwidth_hz: Option<PerJoint>,
    /// Limits of every sample; a sample outside stops the run. For a robot outside the simulator the default is the
    /// robot description's limits with a margin, and a tracking error of 0.3 rad (0.1 m).
    pub envelope: EnvelopeSettings,
    /// Rehearsal: simulation of every motion before a robot outside the simulator executes it.
    pub rehearsal: RehearsalSettings,
    /// Thresholds for oscillations: they stop a run of a robot outside the simulator, and are reported for a log.
    pub oscillation: OscillationSettings,
    /// Rate of the robot's control loop and of the transferred samples, Hz; `[simulation] rate_hz` (1000) by default.
    pub rate_hz: Option<f64>,
    /// Shares of the full speed at which the motion is run before the first run, for example `[0.1, 0.5, 1.0]`; none
    /// by default.
    pub speed_steps: Vec<f64>,
    /// Home posture between runs, rad (m), all joints by name or in the order of the model: every run moves from there
    /// to the start of its motion and back, within the limits of `[design]`. Without it the robot must be at the start
    /// of the motion.
    pub home: Option<StartPosture>,
    /// Share of the velocity and acceleration limits that the paths between home posture and motion use; 0.2 by
    /// default.
    pub approach_speed: f64,
    /// Duration of warm-up motion before the first run of a call, s, so that friction reaches its working
    /// temperature. The warm-up is repeated after a longer pause. 0 (no warm-up) by default. Not available for a
    /// robot behind a folder.
    pub warm_up_s: f64,
    /// A run is rejected if its tracking error exceeds this factor times the error of the last accepted run.
    pub worse_factor: f64,
    /// Maximum number of times that the change of the parameters is halved, before the iteration returns to the
    /// controller without a model.
    pub most_halvings: usize,
    /// Factor on the gains of the controller without a model after each failed run; 2 by default, 1 (unchanged) for a
    /// robot outside the simulator.
    pub stiffen: Option<f64>,
    /// Maximum number of failed runs without a model; after that the iteration ends, because the robot cannot follow
    /// the motion.
    pub most_model_free: usize,
    /// Maximum number of runs.
    pub max_runs: usize,
    /// Convergence thresholds.
    pub settled: ConvergenceSettings,
    /// Thresholds for reporting a difference between logged and commanded torque.
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
    /// Builds the iteration settings with the study's `[controller]`. Runs are identified with `identification`, with
    /// the differentiator and filter of the iteration.
    ///
    /// # Errors
    /// A setting that the identification of a run does not support.
    pub fn settings(
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
        let IdentificationSettings { mut estimation, consistency, friction, offsets, thresholds, .. } = identification;
        let run_offsets = match offsets {
            OffsetChoice::Shared => RunOffsets::WhereSeen,
            OffsetChoice::PerLog => RunOffsets::PerRun,
        };
        // The controller uses the friction that the study describes, unless `friction = "auto"` is set.
        let friction =
            friction.retaining(|search| study.drive.friction_of(&search.joint) == Some(FrictionChoice::Auto));
        if self.scheme == Scheme::StepByStep && !estimation.estimator.is_plain() {
            let key = format!("estimator.method = \"{}\"", estimation.estimator.name());
            return Err(StudyError::conflict(key, "scheme = \"step-by-step\" takes \"ordinary\" or \"weighted\""));
        }
        let in_turn =
            self.scheme == Scheme::StepByStep || self.order == LegOrder::OneAfterAnother && self.leg.len() > 1;
        if in_turn && friction.is_selected() {
            let fix = "the selection needs runs that excite all joints; state the friction, or remove scheme and order from [iteration]";
            return Err(StudyError::conflict("drive.friction = \"auto\"", fix));
        }
        // Tests and the selection of essential parameters belong to the final identification only.
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
                consistency: consistency.filter(|_| !self.literal),
                payloads: study.payloads(),
                run_offsets,
                thresholds,
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
            // Gains of a robot outside the simulator are increased only on request.
            stiffen: self.stiffen.unwrap_or(if self.is_outside() { 1.0 } else { default.stiffen }),
            most_model_free: self.most_model_free,
            max_runs: self.max_runs,
            settled: self.settled.clone(),
            torque_check: Some(self.torque_check.clone()),
            safety: SafetySettings::default(),
        })
    }
}
