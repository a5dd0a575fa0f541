//! Errors in a study: key, value, and valid values.

use super::XacroError;
use core::fmt;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_estimation::consistent::PhysicalError;
use dynident_excitation::families::FamilyError;
use dynident_excitation::limits::LimitError;
use dynident_excitation::optimisers::OptimiserError;
use dynident_excitation::step_wise::StepWiseError;
use dynident_identification::diagnosis::InvalidLimit;
use dynident_identification::estimators::PeriodError;
use dynident_identification::payload::PayloadError;
use dynident_identification::rows::ParallelFilterError;
use dynident_identification::{EventSettingsError, ThresholdError};
use dynident_iteration::IterationError;
use dynident_model::terms::{ExpressionError, TorqueTableError};
use dynident_model::{LoopError, ModelError};
use dynident_recording::FilterError;
use dynident_simulation::SimulationError;
use thiserror::Error;

/// Error in a study.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// The error is in this section or list entry of the study. The text after the place has the cause and the fix.
    #[error("{place}: {source}")]
    At {
        /// Name of the section, or of the list entry.
        place: String,
        /// The error.
        source: Box<StudyError>,
    },
    /// The file is not valid TOML, or a key is misspelt or in the wrong section. Correct it at the printed line.
    #[error("{problem}; page \"The study file\" lists every key: `dynident docs study`")]
    Toml {
        /// Message of the parser.
        problem: String,
    },
    /// An editor saved the study in another encoding, such as Latin-1 or UTF-16. Save it as UTF-8.
    #[error("not UTF-8 text: save the study as UTF-8")]
    NotUtf8,
    /// The file that was given as study is probably a log or another large file. Give the study, a small TOML file.
    #[error("larger than {} MiB: give a study file", most_bytes >> 20)]
    TooLarge {
        /// Maximum size of a study file, bytes.
        most_bytes: u64,
    },
    /// Invalid settings of a fit to commands.
    #[error("{0}")]
    Servo(#[from] dynident_servo::ServoError),
    /// The number of this key is outside its valid range. Write a number within the range that the message names.
    #[error("{key} = {value}: give {expected}")]
    Number {
        /// The key.
        key: String,
        /// Value of the key.
        value: f64,
        /// The valid values.
        expected: Expected,
    },
    /// At least one number in the list of this key is outside its valid range. Write numbers within the range that the
    /// message names.
    #[error("{key} = {values:?}: give {expected}")]
    Numbers {
        /// The key.
        key: String,
        /// Values of the list.
        values: Vec<f64>,
        /// The valid values.
        expected: &'static str,
    },
    /// The list must have one entry for each joint of the robot, in the order of the robot's joints. Add or remove
    /// entries.
    #[error("{key} has {found} entries, the robot {expected} joints: give one entry per joint")]
    Length {
        /// The key.
        key: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of joints.
        expected: usize,
    },
    /// The key names a joint, link, log or other object that does not exist. Use one of the listed names; capital and
    /// small letters differ.
    #[error("{key}: unknown {what} `{name}`; known: {}", known.join(", "))]
    Unknown {
        /// The key.
        key: &'static str,
        /// Kind of object.
        what: &'static str,
        /// The name.
        name: String,
        /// Known names.
        known: Vec<String>,
    },
    /// A name must belong to exactly one `[[log]]`. Correct the name, or give each `[[log]]` a unique `name`.
    #[error("{problem}", problem = log_name(name, *found, known))]
    LogName {
        /// The name.
        name: String,
        /// Number of logs with the name.
        found: usize,
        /// The names of all logs.
        known: Vec<String>,
    },
    /// Two entries of a list have the same name, so that a reference to it would be ambiguous. Rename or remove one of
    /// them.
    #[error("{what} `{name}` is given twice: {fix}")]
    Twice {
        /// Kind of list.
        what: String,
        /// The name.
        name: String,
        /// The fix.
        fix: &'static str,
    },
    /// Two keys contradict each other about one joint. Remove the joint from one of the two keys.
    #[error("{key}: joint `{joint}` is {state} as well: remove it from {key} or from {other}")]
    JointInBoth {
        /// The joint.
        joint: String,
        /// The key.
        key: &'static str,
        /// Name of the other key.
        other: &'static str,
        /// What the other key states about the joint.
        state: &'static str,
    },
    /// A log with `role = "validate"` and a training log select the same rows of one file. Validation then only repeats
    /// the fit. Select different parts in both `[[log]]` entries.
    #[error(
        "validation log `{held_out}` contains samples of the training log `{training}`: select parts that do not overlap in both [[log]] entries (both by rows, by fraction, or by time_range_s), or use another file"
    )]
    Overlap {
        /// Name of the training log.
        training: String,
        /// Name of the held-out log.
        held_out: String,
    },
    /// Two files contain the same recording, for example a copy or a longer export. Validation then only repeats the
    /// fit. Use the recording of another run for validation.
    #[error(
        "validation log `{held_out}` contains the same samples as the training log `{training}`: its row {held_out_row} and the following equal those of `{training}` from row {training_row} (two runs never have identical positions and torques): name the file of another run in this [[log]], or select parts that do not overlap"
    )]
    SameSamples {
        /// Name of the training log.
        training: String,
        /// First common row of the training log, 0-based.
        training_row: u64,
        /// Name of the held-out log.
        held_out: String,
        /// First common row of the held-out log, 0-based.
        held_out_row: u64,
    },
    /// Two training logs contain the same recording. The fit would use these samples twice, and the error bars would be
    /// too small. Remove one of the logs.
    #[error(
        "training logs `{first}` and `{second}` contain the same samples: row {second_row} of `{second}` and the following equal those of `{first}` from row {first_row}, which would make the error bars too small: remove one of the logs, or select rows that do not overlap"
    )]
    RepeatedRows {
        /// Name of the first training log.
        first: String,
        /// First common row of the first log, 0-based.
        first_row: u64,
        /// Name of the second training log.
        second: String,
        /// First common row of the second log, 0-based.
        second_row: u64,
    },
    /// The two keys state the same quantity in two ways. Delete one of them.
    #[error("{} are both given: keep one", keys.join(" and "))]
    Exclusive {
        /// Names of the keys.
        keys: Vec<&'static str>,
    },
    /// The command needs this part of the study, and the study does not have it. Add the key or section that the
    /// message names.
    #[error("{what}: {fix}")]
    Missing {
        /// The missing part of the study.
        what: String,
        /// The fix.
        fix: String,
    },
    /// The key is valid, but it does not fit another key, the robot or the logs. The message names what to change.
    #[error("{key}: {fix}")]
    Conflict {
        /// The key.
        key: String,
        /// The conflict and the fix.
        fix: String,
    },
    /// The job computes torques, but the robot description has no `<inertial>` for these bodies. Add their mass, centre
    /// of mass and inertia to the robot description.
    #[error("the inertial parameters of {} are unknown: {fix}", bodies.join(", "))]
    NoInertials {
        /// Names of the bodies.
        bodies: Vec<String>,
        /// The fix.
        fix: &'static str,
    },
    /// The study has wrong settings for `xacro` under `[robot]`, or `xacro` failed. The text after `robot:` has the
    /// cause.
    #[error("robot: {0}")]
    Xacro(#[source] Box<XacroError>),
    /// `design` needs a limit of how fast each joint may move, and neither the robot description nor the study has one.
    /// Add the printed line under `[design.limits]`.
    #[error(
        "joint `{joint}` has no limit of speed, acceleration, jerk, torque or power, so its motion could be infinitely fast; add one under [design.limits]: joints = [{{ joint = \"{joint}\", acceleration = ... }}]"
    )]
    Unbounded {
        /// The joint.
        joint: String,
    },
    /// A windowed (step-wise) design moves each joint of `criterion.joints` by strokes, and needs its limits of
    /// position and of speed or acceleration. Add them to the entry of this joint in `joints` under `[design.limits]`.
    #[error("joint `{joint}` has no {limit} limit, which a stroke needs: add it to joints under [design.limits]")]
    NoStrokeLimit {
        /// The joint.
        joint: String,
        /// The limit.
        limit: &'static str,
    },
    /// In a windowed (step-wise) design, the start of this joint in `family.offsets` is outside its position limits, or
    /// at the upper limit. Write a start inside the limits.
    #[error(
        "family.offsets: joint `{joint}` starts its stroke at {offset_rad} rad, but its limits are {lower} to {upper} rad: give a start within them, from which the stroke can move in the positive direction",
        lower = limits_rad[0], upper = limits_rad[1]
    )]
    StrokeStart {
        /// The joint.
        joint: String,
        /// Start of the joint's move, rad.
        offset_rad: f64,
        /// Position limits, rad.
        limits_rad: [f64; 2],
    },
    /// An invalid robot model.
    #[error("{0}")]
    Model(#[from] ModelError),
    /// A `[[robot.loop]]` of the study does not describe a closed chain of this robot. The text after the section has
    /// the cause.
    #[error("[[robot.loop]]: {0}")]
    Loop(#[from] LoopError),
    /// The `expression` of a `[[torque]]` cannot be read. The message names the character; see the table *Mistakes in
    /// expressions* below.
    #[error("expression {0}")]
    Expression(#[from] ExpressionError),
    /// The points of a torque table are invalid. See *Torque tables* below.
    #[error("table: {0}")]
    Table(#[from] TorqueTableError),
    /// Bodies and torque terms that do not match.
    #[error("{0}")]
    ParametricModel(#[from] ParametricModelError),
    /// A payload that does not belong to the robot.
    #[error("{0}")]
    Payload(#[from] PayloadError),
    /// An invalid filter, differentiator or reference motion.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// Invalid settings of the parallel filter.
    #[error("{0}")]
    ParallelFilter(#[from] ParallelFilterError),
    /// Invalid settings of the periodic motion of an estimator.
    #[error("{0}")]
    Periods(#[from] PeriodError),
    /// An invalid setting of an estimator.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// An invalid setting of the physically consistent fit.
    #[error("{0}")]
    Physical(#[from] PhysicalError),
    /// An invalid trajectory family.
    #[error("{0}")]
    Family(#[from] FamilyError),
    /// Invalid limits of a motion.
    #[error("{0}")]
    Limits(#[from] LimitError),
    /// Invalid settings of a search.
    #[error("{0}")]
    Optimiser(#[from] OptimiserError),
    /// Invalid settings of a step-wise design.
    #[error("{0}")]
    StepWise(#[from] StepWiseError),
    /// Invalid settings of a simulated robot, a controller or a reference.
    #[error("{0}")]
    Simulation(#[from] SimulationError),
    /// An invalid threshold.
    #[error("{0}")]
    Threshold(#[from] ThresholdError),
    /// An invalid threshold of the search for events.
    #[error("{0}")]
    Events(#[from] EventSettingsError),
    /// An invalid limit of `check`.
    #[error("{0}")]
    Limit(#[from] InvalidLimit),
    /// Invalid settings of an iteration.
    #[error("{0}")]
    Iteration(#[source] Box<IterationError>),
}

impl From<IterationError> for StudyError {
    fn from(error: IterationError) -> Self {
        Self::Iteration(Box::new(error))
    }
}

impl From<XacroError> for StudyError {
    fn from(error: XacroError) -> Self {
        Self::Xacro(Box::new(error))
    }
}

impl StudyError {
    /// For `map_err`: adds `place` to an error.
    pub fn at<E: Into<Self>>(place: impl Into<String>) -> impl FnOnce(E) -> Self {
        move |source| Self::At { place: place.into(), source: Box::new(source.into()) }
    }

    /// Error of a missing part of the study, with its fix.
    pub fn missing(what: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Missing { what: what.into(), fix: fix.into() }
    }

    /// Error of a key that conflicts with the rest of the study.
    pub fn conflict(key: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Conflict { key: key.into(), fix: fix.into() }
    }
}

/// Description of the valid values of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Expected {
    /// Minimum and maximum, inclusive.
    Range(f64, f64),
    /// Limits of a joint's position, rad (m).
    PositionLimits(f64, f64),
    /// Above zero.
    Positive,
    /// Zero or more.
    NotNegative,
    /// Any finite number.
    Finite,
}

impl Expected {
    /// Checks the value of a key; NaN is always invalid.
    ///
    /// # Errors
    /// [`StudyError::Number`].
    pub fn check(self, key: impl Into<String>, value: f64) -> Result<(), StudyError> {
        let holds = match self {
            Self::Range(least, greatest) | Self::PositionLimits(least, greatest) => (least..=greatest).contains(&value),
            Self::Positive => value > 0.0 && value.is_finite(),
            Self::NotNegative => value >= 0.0 && value.is_finite(),
            Self::Finite => value.is_finite(),
        };
        if holds { Ok(()) } else { Err(StudyError::Number { key: key.into(), value, expected: self }) }
    }
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range(least, greatest) => write!(f, "{least} to {greatest}"),
            Self::PositionLimits(least, greatest) => write!(f, "{least} to {greatest}, its position limits"),
            Self::Positive => f.write_str("a positive number"),
            Self::NotNegative => f.write_str("0 or more"),
            Self::Finite => f.write_str("a finite number"),
        }
    }
}

fn log_name(name: &str, found: usize, known: &[String]) -> String {
    let known = known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match found {
        0 => format!("unknown log `{name}`; the study's logs are {known}"),
        _ => format!("{found} logs have the name `{name}`: give each a unique name; the logs are {known}"),
    }
}
