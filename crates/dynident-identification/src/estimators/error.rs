//! Errors of estimators.

use dynident_estimation::EstimationError;
use dynident_rows::LogError;
use thiserror::Error;

/// Reason why an estimator returns no estimate.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EstimatorError {
    /// A recording cannot be read or gives no rows.
    #[error("{0}")]
    Log(#[from] LogError),
    /// The rows do not determine an estimate.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// This log or robot does not meet a requirement of `estimator.method`. Change the study as the message states, or
    /// use `estimator.method = "auto"`.
    #[error("estimator.method = \"{method}\": {message}")]
    Requirement {
        /// Name of the estimator.
        method: &'static str,
        /// Problem and fix.
        message: String,
    },
    /// The instruments are the motion of the same log with a second filter, and it does not cover the samples of the
    /// fit. Leave out short pieces with `rows` or `time_range_s`, or pass raw samples instead of a prepared motion.
    #[error("log `{log}`, instruments: {message}")]
    Instruments {
        /// Name of the log.
        log: String,
        /// Problem and fix.
        message: String,
    },
}
