//! Errors of the diagnosis.

use crate::limits::InvalidLimit;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_rows::LogError;
use thiserror::Error;

/// An error of the diagnosis.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnosisError {
    /// An unreadable recording.
    #[error("{0}")]
    Log(#[from] LogError),
    /// Too few rows.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// Drive inertia that does not suit the robot.
    #[error("{0}")]
    Model(#[from] ParametricModelError),
    /// An invalid limit.
    #[error("{0}")]
    Limit(#[from] InvalidLimit),
}
