//! Everything that can stop an identification, each with the log or the place and the fix in its message.

use crate::consistent::ConsistencyError;
use crate::payload::PayloadError;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_recording::{FilterError, RecordingError};
use thiserror::Error;

/// Why a model could not be identified. A poor fit is not an error.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// Nothing to fit to.
    #[error("no log has the role \"identify\": there is nothing to fit to")]
    NoTrainingLog,
    /// A log that cannot be read.
    #[error("log `{log}`: {source}")]
    Recording {
        /// The log.
        log: String,
        /// What is wrong.
        source: Box<RecordingError>,
    },
    /// A log of other joints than the model has.
    #[error("log `{log}`: there is no joint `{joint}` among its columns, which are of {}", known.join(", "))]
    NoSuchJoint {
        /// The log.
        log: String,
        /// The model's joint.
        joint: String,
        /// The log's joints.
        known: Vec<String>,
    },
    /// A parallel filter that does not exist at the log's rate.
    #[error("log `{log}`, [parallel_filter]: {source}")]
    Filter {
        /// The log.
        log: String,
        /// What is wrong.
        source: FilterError,
    },
    /// A log without the temperature that friction depends on.
    #[error(
        "log `{log}`: friction of joint `{joint}` depends on the temperature, which the log does not have; give its columns as temperature of the format, or leave out the law `temperature`"
    )]
    NoTemperature {
        /// The log.
        log: String,
        /// The first joint that needs it.
        joint: String,
    },
    /// A log that leaves no rows after filtering.
    #[error(
        "log `{log}`: {rows} samples leave nothing behind the parallel filter, which needs {needed}; give a longer part of the log, a higher cut-off, or parallel_filter.enabled = false"
    )]
    NothingLeft {
        /// The log.
        log: String,
        /// Samples of the log.
        rows: u64,
        /// Samples that one filtered row needs.
        needed: usize,
    },
    /// Rows of a log that carry no factor.
    #[error("{log}: {source}")]
    Rows {
        /// The log's label.
        log: String,
        /// What is wrong.
        source: EstimationError,
    },
    /// An estimate that cannot be made.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// A log or robot that lacks what the estimator chosen needs.
    #[error("estimator.method = \"{method}\": {message}")]
    Estimator {
        /// The estimator.
        method: &'static str,
        /// What is wrong, and the fix.
        message: String,
    },
    /// Instruments that do not belong to the log.
    #[error("log `{log}`, instruments: {message}")]
    Instruments {
        /// The log.
        log: String,
        /// What is wrong, and the fix.
        message: String,
    },
    /// A robot whose parts do not fit.
    #[error(transparent)]
    Model(#[from] ParametricModelError),
    /// Payloads, offsets per log or gains that do not go together.
    #[error(transparent)]
    Payload(#[from] PayloadError),
    /// Knowledge of bodies that are not there.
    #[error("[estimator.physical]: {0}")]
    Consistency(ConsistencyError),
    /// Intervals of parameters that cannot be had.
    #[error("estimator.intervals: {0}")]
    Intervals(ConsistencyError),
}

impl IdentificationError {
    /// A log that cannot be read.
    pub(crate) fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }
}
