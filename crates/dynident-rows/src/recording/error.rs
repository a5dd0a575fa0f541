//! Errors of a recording.

use dynident_estimation::EstimationError;
use dynident_recording::{FilterError, RecordingError};
use thiserror::Error;

/// Reason why a recording gives no rows; the message names the recording and the fix.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LogError {
    /// The log cannot be read.
    #[error("log `{log}`: {source}")]
    Recording {
        /// Log.
        log: String,
        /// Cause.
        source: Box<RecordingError>,
    },
    /// A joint of the model is missing in the log.
    #[error("log `{log}`: joint `{joint}` is missing; the columns belong to {}; add columns of this joint, or lock it under [robot]", known.join(", "))]
    NoSuchJoint {
        /// Log.
        log: String,
        /// Joint of the model.
        joint: String,
        /// Joints of the log.
        known: Vec<String>,
    },
    /// The samples of the log cannot be opened.
    #[error("log `{log}` has no samples; give raw samples or a prepared motion")]
    NoSamples {
        /// Log.
        log: String,
    },
    /// The parallel filter is impossible at the log's rate.
    #[error("log `{log}`, [parallel_filter]: {source}")]
    Filter {
        /// Log.
        log: String,
        /// Cause.
        source: FilterError,
    },
    /// The log lacks the temperature on which friction depends.
    #[error(
        "log `{log}`: friction of joint `{joint}` depends on the temperature, but the log has no temperature; give its columns with the key `temperature` of the format, or remove the law `temperature`"
    )]
    NoTemperature {
        /// Log.
        log: String,
        /// First joint that needs it.
        joint: String,
    },
    /// The log leaves the domain of a declared torque.
    #[error(
        "log `{log}`, {time_s:.3} s: torque {torque} = {law} is undefined at {at}; widen the table, keep the expression defined, for example with max(.., 0), or exclude these rows with drop_time_s"
    )]
    Undeclared {
        /// Log.
        log: String,
        /// Time, seconds.
        time_s: f64,
        /// Symbol of the torque.
        torque: String,
        /// Its law.
        law: String,
        /// Positions and velocities at that time.
        at: String,
    },
    /// The log has no rows after the filter.
    #[error(
        "log `{log}`: {rows} samples leave nothing behind the parallel filter, which needs {needed}; give a longer part of the log, a higher cut-off, or parallel_filter.enabled = false"
    )]
    NothingLeft {
        /// Log.
        log: String,
        /// Samples of the log.
        rows: u64,
        /// Samples that one filtered row needs.
        needed: usize,
    },
    /// The rows of the log cannot be factored.
    #[error("{log}: {source}")]
    Rows {
        /// Log.
        log: String,
        /// Cause.
        source: EstimationError,
    },
    /// The consumer rejects the rows.
    #[error("{0}")]
    Refused(#[from] EstimationError),
}

impl LogError {
    /// Wraps an error of a log.
    pub fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }
}
