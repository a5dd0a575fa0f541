//! Everything that can stop an identification, each with the log or the place and the fix in its message.

use crate::consistent::ConsistencyError;
use crate::diagnosis::DiagnosisError;
use crate::estimators::EstimatorError;
use crate::payload::PayloadError;
use crate::recording::LogError;
use crate::reducible::ReduceError;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use thiserror::Error;

/// Why a model could not be identified. A poor fit is not an error.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// Nothing to fit to.
    #[error("no log has the role \"identify\": there is nothing to fit to")]
    NoTrainingLog,
    /// A recording that gives no rows.
    #[error(transparent)]
    Log(#[from] LogError),
    /// An estimate that cannot be made.
    #[error(transparent)]
    Estimation(#[from] EstimationError),
    /// An estimator that gives no estimate.
    #[error(transparent)]
    Estimator(EstimatorError),
    /// A robot whose parts do not fit.
    #[error(transparent)]
    Model(#[from] ParametricModelError),
    /// Payloads, offsets per log or gains that do not go together.
    #[error(transparent)]
    Payload(#[from] PayloadError),
    /// Knowledge of bodies that are not there.
    #[error("[estimator.physical]: {0}")]
    Consistency(ConsistencyError),
    /// Logs that cannot be reduced to factors.
    #[error(transparent)]
    Reduce(#[from] ReduceError),
    /// Intervals of parameters that cannot be had.
    #[error("estimator.intervals: {0}")]
    Intervals(ConsistencyError),
}

impl From<DiagnosisError> for IdentificationError {
    fn from(error: DiagnosisError) -> Self {
        match error {
            DiagnosisError::Log(error) => Self::Log(error),
            DiagnosisError::Model(source) => Self::from(source),
            DiagnosisError::Estimation(error) => Self::Estimation(error),
        }
    }
}

impl From<EstimatorError> for IdentificationError {
    /// What is wrong with a log or with rows stays what it is.
    fn from(error: EstimatorError) -> Self {
        match error {
            EstimatorError::Log(error) => Self::Log(error),
            EstimatorError::Estimation(error) => Self::Estimation(error),
            EstimatorError::Requirement { .. } | EstimatorError::Instruments { .. } => Self::Estimator(error),
        }
    }
}
