//! What an estimator needs and does not find.

use dynident_estimation::EstimationError;
use dynident_rows::LogError;
use thiserror::Error;

/// Why an estimator gives no estimate.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EstimatorError {
    /// A recording that gives no rows.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Rows that do not carry an estimate.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// A log or robot that lacks what the estimator chosen needs.
    #[error("estimator.method = \"{method}\": {message}")]
    Requirement {
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
}
