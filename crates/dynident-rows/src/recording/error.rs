//! What can be wrong with a recording on the way to rows.

use dynident_estimation::EstimationError;
use dynident_recording::{FilterError, RecordingError};
use thiserror::Error;

/// Why a recording gives no rows, with the recording and the fix in its message.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LogError {
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
    /// A log whose samples could not be opened.
    #[error("log `{log}` has no samples: give its raw samples or a motion that is made already")]
    NoSamples {
        /// The log.
        log: String,
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
    /// A log that goes where a declared torque says nothing.
    #[error(
        "log `{log}`, {time_s:.3} s: torque {torque} = {law} says nothing of {at}; widen the table, keep the expression defined with max(.., 0) or the like, or leave these rows out with drop_time_s"
    )]
    Undeclared {
        /// The log.
        log: String,
        /// When, in seconds after its first row.
        time_s: f64,
        /// The torque.
        torque: String,
        /// What it follows.
        law: String,
        /// Positions and velocities there.
        at: String,
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
    /// Rows that their consumer refuses.
    #[error(transparent)]
    Refused(#[from] EstimationError),
}

impl LogError {
    /// A log that cannot be read.
    pub fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }
}
