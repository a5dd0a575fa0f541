//! Everything that can stop an identification, each with the log or the place and the fix in its message.

use crate::consistent::ConsistencyError;
use crate::diagnosis::{DiagnosisError, InvalidLimit};
use crate::estimators::EstimatorError;
use crate::payload::PayloadError;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_rows::LogError;
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
    /// An invalid limit of diagnosis or examination.
    #[error(transparent)]
    Limit(#[from] InvalidLimit),
}

impl From<DiagnosisError> for IdentificationError {
    fn from(error: DiagnosisError) -> Self {
        match error {
            DiagnosisError::Log(error) => Self::Log(error),
            DiagnosisError::Model(source) => Self::from(source),
            DiagnosisError::Estimation(error) => Self::Estimation(error),
            DiagnosisError::Limit(error) => Self::Limit(error),
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

/// Why logs cannot be reduced to factors: something is to be chosen from the samples of all of them.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ReduceError {
    /// The cut-off is left to the logs.
    #[error(
        "the cut-off is left to the logs, and each would have its own: state motion.differentiator.cutoff_hz, or reduce like a model that was identified from some of them"
    )]
    Cutoff,
    /// Whether drives have inertia is left to the logs.
    #[error(
        "whether the torque of joint {joint} holds its drive's inertia is left to the logs: state it (drive.drive_inertia = true or false), or reduce like a model that was identified from some of them"
    )]
    DriveInertia {
        /// The first such joint.
        joint: String,
    },
    /// Friction is left to the logs.
    #[error(
        "the friction of joint {joint} is left to the logs: state it (drive.friction = \"stated\" and its terms), or reduce like a model that was identified from some of them"
    )]
    Friction {
        /// The first such joint.
        joint: String,
    },
    /// Friction that grows with the load needs the samples again.
    #[error("load-dependent friction needs the samples again, with the load of the fit before: leave it out")]
    Load,
    /// Payloads, gains or offsets make columns of single logs.
    #[error("{what} cannot be had from reduced logs: identify them from the logs themselves")]
    Columns {
        /// What is asked for.
        what: &'static str,
    },
    /// An estimator that goes back to the samples.
    #[error("estimator.method = \"{method}\" goes back to the samples: give \"weighted\" or \"ordinary\"")]
    Estimator {
        /// Its name.
        method: &'static str,
    },
}
