//! What can be wrong in a study: the key, the value, and what it may be.

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

/// What is wrong in a study.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// What is wrong at a place of the study.
    #[error("{place}: {source}")]
    At {
        /// The section, or the entry of a list.
        place: String,
        /// What is wrong there.
        source: Box<StudyError>,
    },
    /// A text that TOML does not allow, or a key that a study does not have.
    #[error("{problem}; docs/src/study.md lists every key")]
    Toml {
        /// What the reader says.
        problem: String,
    },
    /// A file in another encoding.
    #[error("not UTF-8 text: save the study as UTF-8")]
    NotUtf8,
    /// A file that is too large for a study.
    #[error("larger than {} MiB: name a study file", most_bytes >> 20)]
    TooLarge {
        /// Most bytes.
        most_bytes: u64,
    },
    /// A number outside its range.
    #[error("{key} = {value}: give {expected}")]
    Number {
        /// The key.
        key: String,
        /// Its value.
        value: f64,
        /// What it may be.
        expected: Expected,
    },
    /// An array with a number outside its range.
    #[error("{key} = {values:?}: give {expected}")]
    Numbers {
        /// The key.
        key: String,
        /// Its values.
        values: Vec<f64>,
        /// What each may be.
        expected: &'static str,
    },
    /// A list that has not one entry for each joint.
    #[error("{key} has {found} entries, the robot {expected} joints: give one each")]
    Length {
        /// The key.
        key: &'static str,
        /// Entries.
        found: usize,
        /// Joints.
        expected: usize,
    },
    /// A name that stands for nothing.
    #[error("{key}: there is no {what} `{name}`; there is {}", known.join(", "))]
    Unknown {
        /// The key.
        key: &'static str,
        /// What was looked for.
        what: &'static str,
        /// The name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A name that no log has, or several have.
    #[error("{}", log_name(name, *found, known))]
    LogName {
        /// The name.
        name: String,
        /// How many logs are called so.
        found: usize,
        /// The names of all logs.
        known: Vec<String>,
    },
    /// A name that stands twice in a list.
    #[error("{what} `{name}` stands twice: {fix}")]
    Twice {
        /// The list.
        what: String,
        /// The name.
        name: String,
        /// What to do.
        fix: &'static str,
    },
    /// A joint under two keys that exclude each other.
    #[error("{key}: joint `{joint}` is {state} as well: take it out of {key} or of {other}")]
    JointInBoth {
        /// The joint.
        joint: String,
        /// The key.
        key: &'static str,
        /// The other key.
        other: &'static str,
        /// What the other key makes of a joint.
        state: &'static str,
    },
    /// A held-out log with samples that the model is fitted to.
    #[error(
        "log `{held_out}` is to test what `{training}` is fitted to, and has samples of it: give the two parts of a file that do not overlap (both by rows, by fraction, or by time_range_s), or another file"
    )]
    Overlap {
        /// The log that is fitted to.
        training: String,
        /// The log to test on.
        held_out: String,
    },
    /// A held-out log that holds samples which the model is fitted to, saved once more.
    #[error(
        "log `{held_out}` is to test what `{training}` is fitted to, and holds the same samples: from its row {held_out_row} on they are those of `{training}` from row {training_row} on (no two runs of a robot agree to the last digit in every position and torque): give a log of another run, or parts that do not overlap"
    )]
    SameSamples {
        /// The log that is fitted to.
        training: String,
        /// Its 0-based data row from which on both are the same.
        training_row: u64,
        /// The log to test on.
        held_out: String,
        /// The same of the log to test on.
        held_out_row: u64,
    },
    /// Keys of which one can be given.
    #[error("{} are both given: keep one", keys.join(" and "))]
    Exclusive {
        /// The keys given.
        keys: Vec<&'static str>,
    },
    /// Something that the job needs and the study does not have.
    #[error("{what}: {fix}")]
    Missing {
        /// What is not there.
        what: String,
        /// What to do.
        fix: String,
    },
    /// A key that does not go with the rest of the study.
    #[error("{key}: {fix}")]
    Conflict {
        /// The key.
        key: String,
        /// With what it does not go, and what to do.
        fix: &'static str,
    },
    /// Bodies whose inertial parameters the job needs.
    #[error("the inertial parameters of {} are unknown: {fix}", bodies.join(", "))]
    NoInertials {
        /// The bodies.
        bodies: Vec<String>,
        /// What to do.
        fix: &'static str,
    },
    /// How the program `xacro` is called.
    #[error("robot: {0}")]
    Xacro(Box<XacroError>),
    /// A joint that nothing keeps from moving infinitely fast.
    #[error(
        "joint `{joint}` has no limit of speed, acceleration, jerk, torque or power, so that the best motion would be infinitely fast; give one: joints = [{{ joint = \"{joint}\", acceleration = ... }}]"
    )]
    Unbounded {
        /// The joint.
        joint: String,
    },
    /// A joint without a limit that its stroke needs.
    #[error("joint `{joint}` has no {limit} limit, which a stroke needs: give one in limits.joints")]
    NoStrokeLimit {
        /// The joint.
        joint: String,
        /// The limit.
        limit: &'static str,
    },
    /// A stroke that begins where its joint may not be.
    #[error(
        "family.offsets: joint `{joint}` starts its stroke at {offset_rad} rad, but its limits are {} to {} rad; a stroke goes up from its offset",
        limits_rad[0], limits_rad[1]
    )]
    StrokeStart {
        /// The joint.
        joint: String,
        /// Where its stroke starts.
        offset_rad: f64,
        /// Its limits.
        limits_rad: [f64; 2],
    },
    /// A robot that cannot be made of its description.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A closed chain that is not what the study says.
    #[error("[[robot.loop]]: {0}")]
    Loop(#[from] LoopError),
    /// An expression that cannot be read.
    #[error("expression {0}")]
    Expression(#[from] ExpressionError),
    /// A table that says no torque.
    #[error("table: {0}")]
    Table(#[from] TorqueTableError),
    /// Bodies and torque terms that do not fit.
    #[error(transparent)]
    ParametricModel(#[from] ParametricModelError),
    /// A payload that does not belong to the robot.
    #[error(transparent)]
    Payload(#[from] PayloadError),
    /// A filter, a differentiator or its reference.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// The parallel filter.
    #[error(transparent)]
    ParallelFilter(#[from] ParallelFilterError),
    /// The repeated motion of an estimator.
    #[error(transparent)]
    Periods(#[from] PeriodError),
    /// A setting of an estimator.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// A setting of the physically consistent fit.
    #[error(transparent)]
    Physical(#[from] PhysicalError),
    /// A trajectory family.
    #[error(transparent)]
    Family(#[from] FamilyError),
    /// Limits of a motion.
    #[error(transparent)]
    Limits(#[from] LimitError),
    /// A search.
    #[error(transparent)]
    Optimiser(#[from] OptimiserError),
    /// A windowed design.
    #[error(transparent)]
    StepWise(#[from] StepWiseError),
    /// A simulated robot, a controller or a reference.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// An iteration.
    #[error(transparent)]
    Iteration(Box<IterationError>),
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
    /// For `map_err`: what is wrong, at `place`.
    pub(crate) fn at<E: Into<Self>>(place: impl Into<String>) -> impl FnOnce(E) -> Self {
        move |source| Self::At { place: place.into(), source: Box::new(source.into()) }
    }

    pub(crate) fn missing(what: impl Into<String>, fix: impl Into<String>) -> Self {
        Self::Missing { what: what.into(), fix: fix.into() }
    }

    pub(crate) fn conflict(key: impl Into<String>, fix: &'static str) -> Self {
        Self::Conflict { key: key.into(), fix }
    }
}

/// What a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Expected {
    /// Least and greatest.
    Range(f64, f64),
    /// The limits of a joint's position, rad (m).
    PositionLimits(f64, f64),
    /// Above zero.
    Positive,
    /// Zero or more.
    NotNegative,
    /// Any that is finite.
    Finite,
}

impl Expected {
    /// The value of a key, if it is as expected; NaN never is.
    ///
    /// # Errors
    /// [`StudyError::Number`].
    pub(crate) fn check(self, key: impl Into<String>, value: f64) -> Result<(), StudyError> {
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
        0 => format!("no log is called `{name}`: the study's logs are {known}"),
        _ => format!("{found} logs are called `{name}`: give each a name of its own; they are {known}"),
    }
}
