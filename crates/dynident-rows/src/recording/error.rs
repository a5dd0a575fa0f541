//! Errors of a recording.

use dynident_estimation::EstimationError;
use dynident_recording::{FilterError, RecordingError};
use thiserror::Error;

/// Reason why a recording gives no rows; the message names the recording and the fix.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LogError {
    /// This log cannot be read. The text after its name contains the cause and the fix.
    #[error("log `{log}`: {source}")]
    Recording {
        /// Log.
        log: String,
        /// Cause.
        source: Box<RecordingError>,
    },
    /// The log has no columns for a joint of the robot model. Add its columns under `[format]`, or add the joint to
    /// `lock` under `[robot]` if it did not move.
    #[error("log `{log}`: joint `{joint}` is missing; the columns belong to {}; add columns of this joint, or lock it under [robot]", known.join(", "))]
    NoSuchJoint {
        /// Log.
        log: String,
        /// Joint of the model.
        joint: String,
        /// Joints of the log.
        known: Vec<String>,
    },
    /// A program passed a log without samples, or the samples cannot be opened again. Pass raw samples or a prepared
    /// motion.
    #[error("log `{log}` has no samples; give raw samples or a prepared motion")]
    NoSamples {
        /// Log.
        log: String,
    },
    /// `[parallel_filter]` does not fit the sampling rate of this log. The text after the section name contains the
    /// cause.
    #[error("log `{log}`, [parallel_filter]: {source}")]
    Filter {
        /// Log.
        log: String,
        /// Cause.
        source: FilterError,
    },
    /// The friction law `temperature` needs the temperature of the joint in each log. Add the columns under
    /// `[format.temperature]`, or remove the law from `[drive]`.
    #[error(
        "log `{log}`: friction of joint `{joint}` depends on the temperature, but the log has no temperature; give its columns with the key `temperature` of the format, or remove the law `temperature`"
    )]
    NoTemperature {
        /// Log.
        log: String,
        /// First joint that needs it.
        joint: String,
    },
    /// The log contains a position or velocity for which a `[[torque]]` has no value. Widen its table, change its
    /// expression, or leave out these rows.
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
    /// The log is too short for the parallel filter, which needs several samples for each row of the fit. If the
    /// message names a problem of the log, such as angles that wrap, correct it first: it lowers the cut-off. Otherwise
    /// use a longer log, a higher cut-off, or `parallel_filter.enabled = false`.
    #[error(
        "log `{log}`: the parallel filter makes no row from {rows} samples, because it needs {needed}; give a longer part of the log, a higher cut-off, or parallel_filter.enabled = false{cause}"
    )]
    NothingLeft {
        /// Log.
        log: String,
        /// Samples of the log.
        rows: u64,
        /// Samples that one filtered row needs.
        needed: usize,
        /// A problem of the log that lowers the cut-off, after a semicolon; empty without one.
        cause: String,
    },
    /// The samples of this log cannot be used in the fit, for example because a value is too large. The text after the
    /// name contains the cause.
    #[error("{log}: {source}")]
    Rows {
        /// Log.
        log: String,
        /// Cause.
        source: EstimationError,
    },
    /// The receiver of the rows rejects them.
    #[error("{0}")]
    Refused(#[from] EstimationError),
}

impl LogError {
    /// Wraps an error of a log.
    pub fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }
}
