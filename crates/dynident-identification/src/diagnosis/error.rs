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
    #[error(transparent)]
    Log(#[from] LogError),
    /// Too few rows.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// Drive inertia that does not suit the robot.
    #[error(transparent)]
    Model(#[from] ParametricModelError),
    /// An invalid limit.
    #[error(transparent)]
    Limit(#[from] InvalidLimit),
}
