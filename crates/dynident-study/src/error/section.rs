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
use dynident_identification::estimators::PeriodError;
use dynident_identification::payload::PayloadError;
use dynident_identification::rows::ParallelFilterError;
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
    /// An error at a place in the study.
    #[error("{place}: {source}")]
    At {
        /// The section, or the list entry.
        place: String,
        /// The error.
        source: Box<StudyError>,
    },
    /// Invalid TOML, or an unknown key.
    #[error("{problem}; page \"The study file\" lists every key: `dynident docs study`")]
    Toml {
        /// Message of the parser.
        problem: String,
    },
    /// Another encoding than UTF-8.
    #[error("not UTF-8 text: save the study as UTF-8")]
    NotUtf8,
    /// A file that is too large for a study.
    #[error("larger than {} MiB: give a study file", most_bytes >> 20)]
    TooLarge {
        /// Maximum size, bytes.
        most_bytes: u64,
    },
    /// Invalid settings of a fit to commands.
    #[error("{0}")]
    Servo(#[from] dynident_servo::ServoError),
    /// A number outside its range.
    #[error("{key} = {value}: give {expected}")]
    Number {
        /// The key.
        key: String,
        /// Its value.
        value: f64,
        /// The valid values.
        expected: Expected,
    },
    /// An array with a number outside its range.
    #[error("{key} = {values:?}: give {expected}")]
    Numbers {
        /// The key.
        key: String,
        /// Its values.
        values: Vec<f64>,
        /// The valid values.
        expected: &'static str,
    },
    /// A list whose length differs from the number of joints.
    #[error("{key} has {found} entries, the robot {expected} joints: give one entry per joint")]
    Length {
        /// The key.
        key: &'static str,
        /// Entries.
        found: usize,
        /// Joints.
        expected: usize,
    },
    /// An unknown name.
    #[error("{key}: unknown {what} `{name}`; known: {}", known.join(", "))]
    Unknown {
        /// The key.
        key: &'static str,
        /// The kind of object.
        what: &'static str,
        /// The name.
        name: String,
        /// The known names.
        known: Vec<String>,
    },
    /// A name of no log, or of several logs.
    #[error("{}", log_name(name, *found, known))]
    LogName {
        /// The name.
        name: String,
        /// Number of logs with the name.
        found: usize,
        /// The names of all logs.
        known: Vec<String>,
    },
    /// A duplicate name in a list.
    #[error("{what} `{name}` is given twice: {fix}")]
    Twice {
        /// The kind of list.
        what: String,
        /// The name.
        name: String,
        /// The fix.
        fix: &'static str,
    },
    /// A joint under two exclusive keys.
    #[error("{key}: joint `{joint}` is {state} as well: remove it from {key} or from {other}")]
    JointInBoth {
        /// The joint.
        joint: String,
        /// The key.
        key: &'static str,
        /// The other key.
        other: &'static str,
        /// State of the joint under the other key.
        state: &'static str,
    },
    /// A held-out log that contains training samples.
    #[error(
        "validation log `{held_out}` contains samples of the training log `{training}`: select parts that do not overlap in both [[log]] entries (both by rows, by fraction, or by time_range_s), or use another file"
    )]
    Overlap {
        /// The training log.
        training: String,
        /// The held-out log.
        held_out: String,
    },
    /// A held-out log in another file that contains the same samples as a training log.
    #[error(
        "validation log `{held_out}` contains the same samples as the training log `{training}`: its row {held_out_row} and the following equal those of `{training}` from row {training_row} (two runs never have identical positions and torques): name the file of another run in this [[log]], or select parts that do not overlap"
    )]
    SameSamples {
        /// The training log.
        training: String,
        /// First common row of the training log, 0-based.
        training_row: u64,
        /// The held-out log.
        held_out: String,
        /// First common row of the held-out log, 0-based.
        held_out_row: u64,
    },
    /// Two training logs that contain the same samples, so that error bars would be too small.
    #[error(
        "training logs `{first}` and `{second}` contain the same samples: row {second_row} of `{second}` and the following equal those of `{first}` from row {first_row}, which would make the error bars too small: remove one of the logs, or select rows that do not overlap"
    )]
    RepeatedRows {
        /// The first training log.
        first: String,
        /// First common row of the first log, 0-based.
        first_row: u64,
        /// The second training log.
        second: String,
        /// First common row of the second log, 0-based.
        second_row: u64,
    },
    /// Exclusive keys.
    #[error("{} are both given: keep one", keys.join(" and "))]
    Exclusive {
        /// The stated keys.
        keys: Vec<&'static str>,
    },
    /// A missing part of the study.
    #[error("{what}: {fix}")]
    Missing {
        /// The missing part.
        what: String,
        /// The fix.
        fix: String,
    },
    /// A key that conflicts with the rest of the study.
    #[error("{key}: {fix}")]
    Conflict {
        /// The key.
        key: String,
        /// The conflict and the fix.
        fix: String,
    },
    /// Bodies without the inertial parameters that a job needs.
    #[error("the inertial parameters of {} are unknown: {fix}", bodies.join(", "))]
    NoInertials {
        /// The bodies.
        bodies: Vec<String>,
        /// The fix.
        fix: &'static str,
    },
    /// An error of the program `xacro` or its settings.
    #[error("robot: {0}")]
    Xacro(#[source] Box<XacroError>),
    /// A joint without a limit on its speed.
    #[error(
        "joint `{joint}` has no limit of speed, acceleration, jerk, torque or power, so its motion could be infinitely fast; add one under [design.limits]: joints = [{{ joint = \"{joint}\", acceleration = ... }}]"
    )]
    Unbounded {
        /// The joint.
        joint: String,
    },
    /// A joint without a limit that its stroke needs.
    #[error("joint `{joint}` has no {limit} limit, which a stroke needs: add it to joints under [design.limits]")]
    NoStrokeLimit {
        /// The joint.
        joint: String,
        /// The limit.
        limit: &'static str,
    },
    /// A stroke that starts outside of the position limits.
    #[error(
        "family.offsets: joint `{joint}` starts its stroke at {offset_rad} rad, but its limits are {} to {} rad: give a start within them, from which the stroke can move in the positive direction",
        limits_rad[0], limits_rad[1]
    )]
    StrokeStart {
        /// The joint.
        joint: String,
        /// Start of the stroke, rad.
        offset_rad: f64,
        /// Position limits, rad.
        limits_rad: [f64; 2],
    },
    /// An invalid robot model.
    #[error("{0}")]
    Model(#[from] ModelError),
    /// An inconsistent closed chain.
    #[error("[[robot.loop]]: {0}")]
    Loop(#[from] LoopError),
    /// An invalid expression.
    #[error("expression {0}")]
    Expression(#[from] ExpressionError),
    /// An invalid torque table.
    #[error("table: {0}")]
    Table(#[from] TorqueTableError),
    /// Bodies and torque terms that do not match.
    #[error("{0}")]
    ParametricModel(#[from] ParametricModelError),
    /// A payload that does not belong to the robot.
    #[error("{0}")]
    Payload(#[from] PayloadError),
    /// A filter, a differentiator or its reference.
    #[error("{0}")]
    Filter(#[from] FilterError),
    /// The parallel filter.
    #[error("{0}")]
    ParallelFilter(#[from] ParallelFilterError),
    /// The periodic motion of an estimator.
    #[error("{0}")]
    Periods(#[from] PeriodError),
    /// A setting of an estimator.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// A setting of the physically consistent fit.
    #[error("{0}")]
    Physical(#[from] PhysicalError),
    /// A trajectory family.
    #[error("{0}")]
    Family(#[from] FamilyError),
    /// Limits of a motion.
    #[error("{0}")]
    Limits(#[from] LimitError),
    /// A search.
    #[error("{0}")]
    Optimiser(#[from] OptimiserError),
    /// A windowed design.
    #[error("{0}")]
    StepWise(#[from] StepWiseError),
    /// A simulated robot, a controller or a reference.
    #[error("{0}")]
    Simulation(#[from] SimulationError),
    /// An iteration.
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

/// Valid values of a number.
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
