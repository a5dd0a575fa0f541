//! Interface of robots: a robot runs a trajectory with a controller and returns a record. Implementations: the
//! built-in simulator, another process, a function, and a folder in which a person exchanges files.

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
mod observer;
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
pub use function::{ControlledRun, FunctionRobot, FunctionStop};
pub use handover::{CONTROLLER_SCHEMA, controller_json, trajectory_csv};
pub use log_mistakes::{ExaminedLog, LogMistake, LogMistakeSettings, examine_log};
pub use log_table::{LogTableError, read_log_table};
pub use observer::{ExpectedTorque, ObservedSample, SampleObserver};
pub(crate) use oscillation_watch::RunOscillations;
pub use process::ProcessRobot;
pub use process_settings::{ProcessLimits, ProcessMode, ProcessSettings};
pub use protocol::{LoggedTorque, PROTOCOL, ToClient, ToHost, WayFiles};
pub use simulated::SimulatedRobot;
pub use stop_reason::{Breach, EnvelopeQuantity, JointOscillation, Stopping};
pub use stop_signal::StopSignal;
pub use ways::{ApproachPaths, RunPart, WayRecords};
pub use workspace::{WatchedPoint, WorkspaceBox, WorkspaceSettings};

use crate::signals::oscillation::OscillationLimits;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use dynident_simulation::{LimitedQuantity, Record, Reference, Run, RunStatus, SimulationError, require_length};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::PathBuf;
use thiserror::Error;

/// Purpose of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunPurpose {
    /// A run that is used for the fit.
    #[default]
    Run,
    /// A warm-up pass along the motion of the next run.
    WarmUp {
        /// Number of the pass, from 1.
        pass: usize,
        /// Number of passes.
        of: usize,
    },
    /// A held-out motion, which validates the model of the run with the same number.
    HeldOut,
}

/// A request to a robot to run a trajectory.
#[derive(Clone, Copy, Debug)]
pub struct RunRequest<'a> {
    /// Number of the run, from 1; it determines the name of the run's folder.
    pub run: usize,
    /// The trajectory; its sampling rate is the rate of the controller.
    pub reference: &'a Reference,
    /// The controller.
    pub controller: &'a ControllerSettings,
    /// The controller's model, if it needs one.
    pub model: Option<&'a ControllerModel>,
    /// Limits of every sample; a run that exceeds them is stopped. `None` disables monitoring.
    pub envelope: Option<&'a Envelope>,
    /// Oscillation that stops the run; `None` disables monitoring.
    pub oscillation: Option<OscillationLimits>,
    /// Signal that stops the run.
    pub stop: Option<&'a StopSignal>,
    /// Receives every sample when it arrives, if the robot sends samples during the motion.
    pub observer: Option<&'a dyn SampleObserver>,
    /// Speed of the reference as a share of the trajectory's speed; below 1 only in slow motions before the first
    /// run.
    pub speed: f64,
    /// Purpose of the motion.
    pub purpose: RunPurpose,
    /// Paths from the home posture to the motion and back. Without them the robot has to be at the beginning of the
    /// motion.
    pub ways: Option<&'a ApproachPaths>,
}

impl<'a> RunRequest<'a> {
    /// Creates a request without model, envelope and stop signal; set the fields that are needed.
    pub fn new(run: usize, reference: &'a Reference, controller: &'a ControllerSettings) -> Self {
        Self {
            run,
            reference,
            controller,
            model: None,
            envelope: None,
            oscillation: None,
            stop: None,
            observer: None,
            speed: 1.0,
            purpose: RunPurpose::Run,
            ways: None,
        }
    }

    /// Name of the folder for the files of the run; slow motions and warm-ups have separate folders.
    pub fn folder_name(&self) -> String {
        let run = format!("run_{}", self.run);
        match self.purpose {
            RunPurpose::WarmUp { pass, .. } => format!("{run}_warm_up_{pass}"),
            RunPurpose::HeldOut => format!("{run}_held_out"),
            RunPurpose::Run if self.speed < 1.0 => format!("{run}_speed_{}", self.speed),
            RunPurpose::Run => run,
        }
    }

    /// Returns the complete commanded trajectory: approach, motion and return, or only the motion.
    ///
    /// # Errors
    /// Paths that belong to another motion.
    pub fn whole(&self) -> Result<Cow<'a, Reference>, SimulationError> {
        let whole = self.ways.map(|ways| ways.around(self.reference)).transpose()?;
        Ok(whole.map_or(Cow::Borrowed(self.reference), Cow::Owned))
    }

    /// Whether a stop was requested.
    pub fn stop_requested(&self) -> bool {
        self.stop.is_some_and(StopSignal::is_requested)
    }

    /// Checks that reference, controller and model have `joints` joints.
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

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotRun {
    /// How the run ended.
    pub status: RobotStatus,
    /// The record of the motion, up to its end or the failure. Joints are in the model's order; all values are
    /// finite.
    pub record: Record,
    /// The true motion, if the robot is the simulator.
    pub truth: Option<Run>,
    /// The records of the paths from and to the home posture, if available.
    pub ways: Option<WayRecords>,
    /// Description of the change of the record's time stamps; `None` if they were not changed.
    pub note: Option<String>,
}

impl RobotRun {
    /// Creates a run without recorded samples.
    pub fn without_samples(status: RobotStatus, joints: &[String], rate_hz: f64) -> Self {
        Self { status, record: recorder::empty_record(joints, rate_hz), truth: None, ways: None, note: None }
    }

    /// Describes how the run ended. If the record shows why it was stopped, adds the reason: torque that did not
    /// respond, or an oscillation of at least `lowest_hz` (Hz).
    pub fn ending(&self, reference: &Reference, lowest_hz: f64) -> String {
        let of_joint = |(joint, time_s)| held_torque::held_torque(reference, &self.record, joint, time_s);
        let held = self.status.too_far().and_then(of_joint).map(|held| held.to_string());
        let oscillation = || oscillation_watch::oscillation_at_end(reference, &self.record, lowest_hz);
        let shown = held.or_else(|| self.status.is_stopped_by_a_limit().then(oscillation)?.map(|own| own.to_string()));
        let parts = [Some(self.status.to_string()), shown, self.note.clone()];
        parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
    }

    /// Returns the largest tracking error of each joint at the record's times, rad (m), with linear interpolation of
    /// the reference.
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

/// How a run of a robot ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum RobotStatus {
    /// The trajectory was completed.
    Done,
    /// The simulated run stopped early: divergence or a limit.
    Simulated {
        /// Status of the simulation.
        verdict: RunStatus,
    },
    /// The robot stopped early and gave a reason.
    Stopped {
        /// The reason.
        reason: String,
    },
    /// A stop was requested (Ctrl-C).
    Interrupted {
        /// Whether the stop was confirmed.
        stopping: Stopping,
    },
    /// A sample was outside the envelope, and the run was stopped.
    LeftEnvelope {
        /// The violation.
        breach: Breach,
        /// Whether the stop was confirmed.
        stopping: Stopping,
    },
    /// A joint oscillated about its trajectory, and the run was stopped.
    Oscillated {
        /// The oscillation.
        oscillation: JointOscillation,
        /// Whether the stop was confirmed.
        stopping: Stopping,
    },
    /// The communication with the robot failed.
    Failed {
        /// The fault.
        fault: RobotFault,
        /// Whether the stop was confirmed; `None` if no motion was running, or if the robot could not be reached.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stopping: Option<Stopping>,
    },
    /// The log does not exist yet: a person has to run the trajectory and save it.
    Waiting {
        /// Folder of the run.
        folder: PathBuf,
        /// The missing input.
        reason: String,
    },
}

impl RobotStatus {
    /// Whether the trajectory was completed.
    pub fn is_done(&self) -> bool {
        *self == Self::Done
    }

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

    /// The joint whose tracking error caused the stop, and the time, s.
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
            Self::Interrupted { stopping } => write!(f, "a stop was requested: {stopping}"),
            Self::LeftEnvelope { breach, stopping } => write!(f, "out of the envelope: {breach}; {stopping}"),
            Self::Oscillated { oscillation, stopping } => write!(f, "{stopping}: {oscillation}"),
            Self::Failed { fault, stopping: None } => write!(f, "{fault}"),
            Self::Failed { fault, stopping: Some(stopping) } => write!(f, "{fault}; {stopping}"),
            Self::Waiting { folder, reason } => write!(f, "{}: {reason}", folder.display()),
        }
    }
}

/// A failure of the communication with an external robot.
#[derive(Clone, Debug, PartialEq, Error, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RobotFault {
    /// `command` under `[iteration.robot]` names a program that does not exist or is not executable. Correct the
    /// command.
    #[error("robot program {program}: cannot be started: {reason}")]
    NotStarted {
        /// Name of the program.
        program: String,
        /// Error of the operating system.
        reason: String,
    },
    /// The program stopped with an error. The message contains its last text on standard error.
    #[error("the robot program ended before it sent its {waiting_for} ({exit}){said}")]
    Died {
        /// The message that was expected.
        waiting_for: String,
        /// Exit status of the program.
        exit: String,
        /// The end of the program's standard error, or an empty string.
        said: String,
    },
    /// The program waits for something, or is slower than the limit. Run it by hand to see what it waits for.
    #[error(
        "the robot program sent no {waiting_for} within {limit_s} s: check the program, or raise this limit in limits of [iteration.robot]"
    )]
    Hung {
        /// The message that was expected.
        waiting_for: String,
        /// The time limit, s.
        limit_s: f64,
    },
    /// The connection to the robot was lost, or the program stopped reading samples. Dynident sent a stop.
    #[error(
        "the robot program sent its samples in real time and then none for {limit_s:.2} s: check the program; if such a pause is normal, increase limits.silence_s"
    )]
    Silent {
        /// The time limit, s.
        limit_s: f64,
    },
    /// The program printed other text to standard output, which is reserved for messages. Print such text to standard
    /// error.
    #[error("the robot program wrote a line that is not a message ({reason}): {line}")]
    Garbage {
        /// The line, cut to 200 characters.
        line: String,
        /// Why it is invalid.
        reason: String,
    },
    /// The program does not keep the order of the messages. Compare it with the page "External robots: the line
    /// protocol".
    #[error("the robot program sent a message of type {found} instead of {expected}")]
    OutOfTurn {
        /// Type of the message.
        found: String,
        /// Expected type of the message.
        expected: String,
    },
    /// The program sent a sample with a missing, NaN or infinite value. Correct the program.
    #[error("sample {sample} of the robot: {what} is not a finite number")]
    NotANumber {
        /// Index of the sample, from 0.
        sample: usize,
        /// The value.
        what: String,
    },
    /// The program sent a sample with the wrong number of joints. Send one entry for each joint of its `hello`.
    #[error("sample {sample} of the robot: {what} has {found} entries for {expected} joints")]
    WrongJoints {
        /// Index of the sample, from 0.
        sample: usize,
        /// Name of the vector.
        what: String,
        /// Number of joints.
        expected: usize,
        /// Number of entries.
        found: usize,
    },
    /// The joint names in the `hello` of the program must be those of the robot description. Correct one of the two, or
    /// lock joints in the study.
    #[error("the robot has the joints {}; expected {}", found.join(", "), expected.join(", "))]
    OtherJoints {
        /// Joints of the model.
        expected: Vec<String>,
        /// Joints of the robot.
        found: Vec<String>,
    },
    /// The times of two samples are equal or in the wrong order. Send each sample once, with the time of the robot's
    /// clock.
    #[error("sample {sample} of the robot: time {time_s} s comes after {before_s} s")]
    Time {
        /// Index of the sample, from 0.
        sample: usize,
        /// Time of the sample, s.
        time_s: f64,
        /// Time of the previous sample, s.
        before_s: f64,
    },
    /// The program sends samples faster than the stated rate, or did not stop after the motion. Correct the program.
    #[error("the robot sent more than {most} samples for a run of {duration_s} s")]
    TooMuch {
        /// Maximum number of samples.
        most: usize,
        /// Duration of the run, s.
        duration_s: f64,
    },
    /// The program was written for another version of the protocol, or lacks the `mode` of `[iteration.robot]`. Adapt
    /// the program, or change `mode`.
    #[error("the robot program supports {found}, not {expected}")]
    Protocol {
        /// What the program supports.
        found: String,
        /// What is required.
        expected: String,
    },
    /// The `hello` of the program states that it logs a torque without gravity or friction, or currents with invalid
    /// factors. Log the complete drive torque, or correct the factors.
    #[error("the robot logs torque {what}: {fix}")]
    LoggedTorque {
        /// The logged quantity.
        what: String,
        /// Suggested fix.
        fix: String,
    },
    /// The program reported success, but did not send all samples. Send the samples until the end of the motion.
    #[error("the robot reported done, but its record of the {} ends at {end_s} s of {duration_s} s", .part.name())]
    Short {
        /// Last time in the record, s.
        end_s: f64,
        /// Duration of the trajectory, s.
        duration_s: f64,
        /// The part of the run that is incomplete.
        #[serde(default, skip_serializing_if = "RunPart::is_motion")]
        part: RunPart,
    },
    /// Without the path from home, the robot would jump to the start of the motion, so the program is not started on
    /// it.
    #[error(
        "the study has a home, but the robot program does not report in its hello that it runs the paths from and to home (\"capabilities\":[\"home\"]): let it run approach.csv before and return.csv after the trajectory, use mode = \"step\", or remove home from [iteration] and move the robot to its start yourself"
    )]
    NoWays,
    /// The controller computed NaN or an infinite torque, usually because a measured position or velocity was wrong.
    /// Check the samples of the robot.
    #[error("the controller's torque at sample {sample} is not a finite number")]
    Torque {
        /// Index of the sample, from 0.
        sample: usize,
    },
    /// The times that the program sends are probably in ms or µs.
    #[error(
        "sample {sample} of the robot: its time is {step_s} s after the previous one, but the period is {period_s} s: give the time in seconds"
    )]
    Clock {
        /// Index of the sample, from 0.
        sample: usize,
        /// Step between two samples, s.
        step_s: f64,
        /// Sampling period, s.
        period_s: f64,
    },
    /// The function that a program passed as robot raised an error. The text after the sample has its message.
    #[error("the function of the robot failed at sample {sample}: {reason}")]
    Function {
        /// Index of the sample, from 0.
        sample: usize,
        /// The reason.
        reason: String,
    },
    /// A file that is exchanged with the robot cannot be read or written, or its content is invalid. The text after the
    /// path has the cause.
    #[error("{}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Error of the operating system, or of the content.
        reason: String,
    },
}

/// A robot: the interface between an experiment and the robot, real or simulated.
pub trait Robot: core::fmt::Debug {
    /// Whether a person has corrected the log of a run since it was read. `folder_name` is that of its request
    /// ([`RunRequest::folder_name`]), `kept` the stored record along `reference`. Only a robot with logs from a person
    /// may return true; the corrected log is then evaluated again.
    fn has_corrected_log(&self, _folder_name: &str, _reference: &Reference, _kept: &Record) -> bool {
        false
    }

    /// Runs a trajectory. Failures of the robot are reported in the run's [`RobotStatus`], with the partial record.
    ///
    /// # Errors
    /// An invalid request ([`RunRequest::validate`]), or settings of the robot that contradict it.
    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError>;
}
