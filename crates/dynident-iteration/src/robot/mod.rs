//! The robot as an experiment sees it: something that runs a trajectory under a controller and gives a record back. The
//! built-in simulator, another process, or a person with a folder.

mod client;
mod conversation;
mod envelope;
mod folder;
mod folder_forms;
mod function;
mod handover;
mod held_torque;
mod log_mistakes;
mod log_table;
mod oscillation_watch;
mod process;
mod process_settings;
mod protocol;
mod recorder;
mod search_limits;
mod simulated;
mod stop_reason;
mod stop_signal;
mod stream_watch;
mod term_description;
mod ways;
mod workspace;

pub use envelope::{Envelope, EnvelopeSettings};
pub(crate) use envelope::{TRACKING_M, TRACKING_RAD};
pub use folder::{FolderRobot, FolderSettings};
pub use folder_forms::FolderForm;
pub use function::{ControlledRun, FunctionRobot};
pub use handover::{CONTROLLER_SCHEMA, controller_json, trajectory_csv};
pub use log_mistakes::{ExaminedLog, LogMistake, LogMistakeSettings, examine_log};
pub use log_table::{LogTableError, read_log_table};
pub(crate) use oscillation_watch::RunOscillations;
pub use process::ProcessRobot;
pub use process_settings::{ProcessLimits, ProcessMode, ProcessSettings};
pub use protocol::{LoggedTorque, PROTOCOL, ToClient, ToHost, WayFiles};
pub use simulated::SimulatedRobot;
pub use stop_reason::{Breach, EnvelopeQuantity, JointOscillation, Stopping};
pub use stop_signal::StopSignal;
pub use ways::{RunPart, WayRecords, Ways};
pub use workspace::{WatchedPoint, WorkspaceBox, WorkspaceSettings};

use crate::oscillation::OscillationLimits;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{LimitedQuantity, Record, Reference, Run, RunStatus, SimulationError, require_length};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::PathBuf;
use thiserror::Error;

/// What a motion is made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunPurpose {
    /// A run.
    #[default]
    Run,
    /// So that the robot is warm: a pass along the motion of the run after it.
    WarmUp {
        /// Number of the pass, from 1.
        pass: usize,
        /// How many there are.
        of: usize,
    },
    /// Another motion, to judge the model that a run has given: the run's number is that one's.
    HeldOut,
}

/// What a robot is asked to do.
#[derive(Clone, Copy, Debug)]
pub struct RunRequest<'a> {
    /// Number of the run, from 1: the name of its folder, and what a log can be matched by.
    pub run: usize,
    /// What to follow; its rate is the controller's.
    pub reference: &'a Reference,
    /// The controller.
    pub controller: &'a ControllerSettings,
    /// Its model, if it needs one.
    pub model: Option<&'a ControllerModel>,
    /// What no sample may leave; a run that does is stopped. None watches nothing.
    pub envelope: Option<&'a Envelope>,
    /// Oscillation that stops the run; `None` disables monitoring.
    pub oscillation: Option<OscillationLimits>,
    /// Who may ask for a stop.
    pub stop: Option<&'a StopSignal>,
    /// Share of the trajectory's own speed that the reference has; 1 but for slow runs before the first.
    pub speed: f64,
    /// What it is made for.
    pub purpose: RunPurpose,
    /// The ways to the motion and back: the robot waits where the approach begins, and is left where the return ends.
    /// Without them it has to stand where the motion begins.
    pub ways: Option<&'a Ways>,
}

impl<'a> RunRequest<'a> {
    /// A run without a model, an envelope and anybody who may stop it: set the fields.
    pub fn new(run: usize, reference: &'a Reference, controller: &'a ControllerSettings) -> Self {
        Self {
            run,
            reference,
            controller,
            model: None,
            envelope: None,
            oscillation: None,
            stop: None,
            speed: 1.0,
            purpose: RunPurpose::Run,
            ways: None,
        }
    }

    /// Name of the folder for its files: a slow run, or one that warms up, is no other's.
    pub fn folder_name(&self) -> String {
        let run = format!("run_{}", self.run);
        match self.purpose {
            RunPurpose::WarmUp { pass, .. } => format!("{run}_warm_up_{pass}"),
            RunPurpose::HeldOut => format!("{run}_held_out"),
            RunPurpose::Run if self.speed < 1.0 => format!("{run}_speed_{}", self.speed),
            RunPurpose::Run => run,
        }
    }

    /// What is commanded where one controller runs through all of it: approach, motion and return, or the motion alone.
    ///
    /// # Errors
    /// Ways of another motion.
    pub fn whole(&self) -> Result<Cow<'a, Reference>, SimulationError> {
        let whole = self.ways.map(|ways| ways.around(self.reference)).transpose()?;
        Ok(whole.map_or(Cow::Borrowed(self.reference), Cow::Owned))
    }

    /// Whether a stop was asked for.
    pub fn stop_requested(&self) -> bool {
        self.stop.is_some_and(StopSignal::is_requested)
    }

    /// Checks that reference, controller and model belong to so many joints.
    ///
    /// # Errors
    /// [`SimulationError`].
    pub fn validate(&self, joints: usize) -> Result<(), SimulationError> {
        require_length("joints of the reference", joints, self.reference.joints())?;
        self.controller.validate(joints)?;
        self.ways.map_or(Ok(()), |ways| ways.validate(self.reference))?;
        match self.model {
            Some(model) => model.check_joints(joints),
            None if self.controller.needs_model() => {
                Err(SimulationError::NoModel { controller: self.controller.name() })
            }
            None => Ok(()),
        }
    }
}

/// What came back.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotRun {
    /// How it ended.
    pub status: RobotStatus,
    /// What was recorded along the motion, up to the end or up to what went wrong. Joints in the model's order, all
    /// numbers finite.
    pub record: Record,
    /// What truly was along the motion, if the robot is the simulator.
    pub truth: Option<Run>,
    /// What was recorded along the ways, where the request had some and they are known.
    pub ways: Option<WayRecords>,
    /// Change of the record's time stamps in words; `None` if they are used as they are.
    pub note: Option<String>,
}

impl RobotRun {
    /// A run of which nothing was recorded.
    pub fn without_samples(status: RobotStatus, joints: &[String], rate_hz: f64) -> Self {
        Self { status, record: recorder::empty_record(joints, rate_hz), truth: None, ways: None, note: None }
    }

    /// How it ended, in words, and what its record shows of why it was stopped: a torque that no longer answered, or an
    /// oscillation of at least `lowest_hz`.
    pub fn ending(&self, reference: &Reference, lowest_hz: f64) -> String {
        let of_joint = |(joint, time_s)| held_torque::held_torque(reference, &self.record, joint, time_s);
        let held = self.status.too_far().and_then(of_joint).map(|held| held.to_string());
        let oscillation = || oscillation_watch::oscillation_at_end(reference, &self.record, lowest_hz);
        let shown = held.or_else(|| self.status.is_stopped_by_a_limit().then(oscillation)?.map(|own| own.to_string()));
        let parts = [Some(self.status.to_string()), shown, self.note.clone()];
        parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
    }

    /// Per joint: largest distance of the recorded positions from the reference at the record's times, rad (m); the
    /// reference between its samples by straight lines.
    pub fn max_error(&self, reference: &Reference) -> Vec<f64> {
        (0..self.record.joints.len())
            .map(|joint| {
                let own = self.record.q[self.record.of(joint)].iter().zip(&self.record.times_s);
                own.fold(0.0_f64, |most, (q, time_s)| {
                    most.max((envelope::target_at(reference, joint, *time_s) - q).abs())
                })
            })
            .collect()
    }
}

/// How a robot's run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum RobotStatus {
    /// The whole trajectory was run.
    Done,
    /// The run stopped early: divergence or a limit of the simulator.
    Simulated {
        /// Its verdict.
        verdict: RunStatus,
    },
    /// The robot stopped early and said why.
    Stopped {
        /// What it said.
        reason: String,
    },
    /// Somebody asked for a stop (Ctrl-C), and the run was given up.
    Interrupted {
        /// What became of the stop.
        stopping: Stopping,
    },
    /// A sample left its envelope, and the run was stopped.
    LeftEnvelope {
        /// Which.
        breach: Breach,
        /// What became of the stop.
        stopping: Stopping,
    },
    /// A joint oscillated about its trajectory, and the run was stopped.
    Oscillated {
        /// Which, and how.
        oscillation: JointOscillation,
        /// What became of the stop.
        stopping: Stopping,
    },
    /// The exchange with the robot failed.
    Failed {
        /// How.
        fault: RobotFault,
        /// What became of the stop; none where no motion was under way, and where nobody could be told.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stopping: Option<Stopping>,
    },
    /// The log is not there yet: somebody has to run the trajectory and drop it.
    Waiting {
        /// The run's folder.
        folder: PathBuf,
        /// What is missing.
        reason: String,
    },
}

impl RobotStatus {
    /// Whether the whole trajectory was run.
    pub fn is_done(&self) -> bool {
        *self == Self::Done
    }

    /// Whether a limit of a joint ended it, on either side.
    fn is_stopped_by_a_limit(&self) -> bool {
        match self {
            Self::Simulated { verdict } => !verdict.is_done(),
            Self::LeftEnvelope { .. } | Self::Stopped { .. } => true,
            Self::Done
            | Self::Interrupted { .. }
            | Self::Oscillated { .. }
            | Self::Failed { .. }
            | Self::Waiting { .. } => false,
        }
    }

    /// The joint that was stopped for its distance from the trajectory, and when, s.
    fn too_far(&self) -> Option<(&str, f64)> {
        match self {
            Self::Simulated { verdict: RunStatus::LimitBroken { time_s, joint, quantity, .. } } => {
                (*quantity == LimitedQuantity::TrackingError).then_some((joint, *time_s))
            }
            Self::LeftEnvelope { breach, .. } => (breach.quantity == EnvelopeQuantity::TrackingError
                && breach.part.is_motion())
            .then_some((&breach.joint, breach.time_s)),
            _ => None,
        }
    }
}

impl core::fmt::Display for RobotStatus {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Done => write!(f, "done"),
            Self::Simulated { verdict } => write!(f, "{verdict}"),
            Self::Stopped { reason } => write!(f, "the robot stopped: {reason}"),
            Self::Interrupted { stopping } => write!(f, "a stop was asked for: {stopping}"),
            Self::LeftEnvelope { breach, stopping } => write!(f, "out of the envelope: {breach}; {stopping}"),
            Self::Oscillated { oscillation, stopping } => write!(f, "{stopping}: {oscillation}"),
            Self::Failed { fault, stopping: None } => write!(f, "{fault}"),
            Self::Failed { fault, stopping: Some(stopping) } => write!(f, "{fault}; {stopping}"),
            Self::Waiting { folder, reason } => write!(f, "{}: {reason}", folder.display()),
        }
    }
}

/// How an exchange with a robot outside can fail.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RobotFault {
    /// The program cannot be started.
    #[error("robot program {program}: cannot be started: {reason}")]
    NotStarted {
        /// The program.
        program: String,
        /// What the system says.
        reason: String,
    },
    /// The program ended in between.
    #[error("the robot program ended while its {waiting_for} was awaited ({exit}){said}")]
    Died {
        /// What was awaited.
        waiting_for: String,
        /// Its exit status.
        exit: String,
        /// The end of what it wrote to standard error, or nothing.
        said: String,
    },
    /// No answer in time.
    #[error("the robot program gave no {waiting_for} within {limit_s} s")]
    Hung {
        /// What was awaited.
        waiting_for: String,
        /// The limit.
        limit_s: f64,
    },
    /// Samples came in real time, and then none in the middle of the motion.
    #[error(
        "the robot program sent its samples in real time and then none for {limit_s:.2} s: look at the program; if such a pause is normal, give a larger limits.silence_s"
    )]
    Silent {
        /// The limit.
        limit_s: f64,
    },
    /// A line that is no message of the protocol.
    #[error("the robot program wrote a line that is no message ({reason}): {line}")]
    Garbage {
        /// The line, cut to 200 characters.
        line: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A message at the wrong moment.
    #[error("the robot program wrote a message of type {found} where {expected} was awaited")]
    OutOfTurn {
        /// What came.
        found: String,
        /// What was awaited.
        expected: String,
    },
    /// A number that is none, or is missing.
    #[error("sample {sample} of the robot: {what} is not a finite number")]
    NotANumber {
        /// The sample, from 0.
        sample: usize,
        /// Which number.
        what: String,
    },
    /// Vectors of another length.
    #[error("sample {sample} of the robot: {what} has {found} entries for {expected} joints")]
    WrongJoints {
        /// The sample, from 0.
        sample: usize,
        /// Which vector.
        what: String,
        /// How many joints there are.
        expected: usize,
        /// How many entries came.
        found: usize,
    },
    /// The robot has other joints.
    #[error("the robot names its joints {}; expected {}", found.join(", "), expected.join(", "))]
    OtherJoints {
        /// The model's.
        expected: Vec<String>,
        /// The robot's.
        found: Vec<String>,
    },
    /// Time that does not go forward.
    #[error("sample {sample} of the robot: time {time_s} s comes after {before_s} s")]
    Time {
        /// The sample, from 0.
        sample: usize,
        /// Its time.
        time_s: f64,
        /// The time before.
        before_s: f64,
    },
    /// More samples than any run has.
    #[error("the robot sent more than {most} samples for a run of {duration_s} s")]
    TooMuch {
        /// How many are taken.
        most: usize,
        /// The run's length.
        duration_s: f64,
    },
    /// Another version of the protocol, or a mode that it does not have.
    #[error("the robot program speaks {found}, not {expected}")]
    Protocol {
        /// What it says.
        found: String,
        /// What is needed.
        expected: String,
    },
    /// The robot logs something from which its dynamics cannot be told.
    #[error("the robot logs torque {what}: {fix}")]
    LoggedTorque {
        /// What it logs.
        what: String,
        /// What to do.
        fix: String,
    },
    /// The record ends before the trajectory does.
    #[error("the robot says done, but its record of the {} ends at {end_s} s of {duration_s} s", .part.name())]
    Short {
        /// The record's last time.
        end_s: f64,
        /// The trajectory's.
        duration_s: f64,
        /// The part of the run.
        #[serde(default, skip_serializing_if = "RunPart::is_motion")]
        part: RunPart,
    },
    /// A program that does not know of ways would run the motion from wherever its robot stands.
    #[error(
        "the study states a home, and the robot program does not say in its hello that it runs the ways from there and back (\"capabilities\":[\"home\"]): let it run approach.csv before and return.csv after the trajectory, take mode = \"step\", or take home out of [iteration] and bring the robot to its start yourself"
    )]
    NoWays,
    /// The controller gave a torque that is not a number.
    #[error("the controller's torque at sample {sample} is not a finite number")]
    Torque {
        /// The sample, from 0.
        sample: usize,
    },
    /// A file that cannot be written or read.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says, or what is wrong inside.
        reason: String,
    },
}

/// A robot: the seam between an experiment and what it runs on.
pub trait Robot: core::fmt::Debug {
    /// What it is, for messages.
    fn name(&self) -> &str;

    /// Names of its joints, in the model's order.
    fn joints(&self) -> &[String];

    /// Whether a person has corrected the log of a run since it was read: `folder_name` is that of its request
    /// ([`RunRequest::folder_name`]), `kept` what was recorded along `reference`. Only a robot whose logs a person
    /// brings may answer true: then the run is judged anew from the corrected log.
    fn has_corrected_log(&self, _folder_name: &str, _reference: &Reference, _kept: &Record) -> bool {
        false
    }

    /// Runs a trajectory. What the robot does wrong is the run's [`RobotStatus`], with the records so far.
    ///
    /// # Errors
    /// Only a request without meaning: [`RunRequest::validate`], or settings of the robot that contradict it.
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError>;
}
