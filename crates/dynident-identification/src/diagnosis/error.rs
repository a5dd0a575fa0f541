//! Why a diagnosis could not be made.

use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_rows::LogError;
use thiserror::Error;

/// Why a diagnosis could not be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DiagnosisError {
    /// A recording that cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Rows that carry no estimate.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// Drive inertia that the robot cannot have.
    #[error(transparent)]
    Model(#[from] ParametricModelError),
}
