//! Errors of an identification; each message contains the log or the place, and the fix.

use crate::consistent::ConsistencyError;
use crate::diagnosis::DiagnosisError;
use crate::estimators::EstimatorError;
use crate::limits::InvalidLimit;
use crate::payload::PayloadError;
use crate::thresholds::ThresholdError;
use dynident_dynamics::ParametricModelError;
use dynident_estimation::EstimationError;
use dynident_events::EventSettingsError;
use dynident_rows::LogError;
use thiserror::Error;

/// Reason for a failed identification. A poor fit is not an error.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// Every `[[log]]` of the study has `role = "validate"`. The fit needs at least one other log.
    #[error(
        "no log has the role \"identify\", so there are no data for the fit: remove role = \"validate\" from one [[log]]"
    )]
    NoTrainingLog,
    /// A recording cannot be read or gives no rows.
    #[error("{0}")]
    Log(#[from] LogError),
    /// The estimation fails.
    #[error("{0}")]
    Estimation(#[from] EstimationError),
    /// The estimator fails.
    #[error("{0}")]
    Estimator(#[source] EstimatorError),
    /// Friction or drive terms do not match the robot.
    #[error("{0}")]
    Model(#[from] ParametricModelError),
    /// Payloads, offsets per log or gains contradict each other.
    #[error("{0}")]
    Payload(#[from] PayloadError),
    /// The values that the study states for bodies or laws under `[estimator.physical]` do not fit the robot. The text
    /// after the section has the cause.
    #[error("[estimator.physical]: {0}")]
    Consistency(#[source] ConsistencyError),
    /// The logs cannot be reduced to factors.
    #[error("{0}")]
    Reduce(#[from] ReduceError),
    /// A threshold is invalid.
    #[error("{0}")]
    Threshold(#[from] ThresholdError),
    /// The intervals of the physically consistent set cannot be computed. The text after the key has the cause; remove
    /// `intervals` under `[estimator]` to continue without them.
    #[error("estimator.intervals: {0}")]
    Intervals(#[source] ConsistencyError),
    /// An invalid setting of the search for events.
    #[error("{0}")]
    Events(#[from] EventSettingsError),
    /// An invalid limit of diagnosis or examination.
    #[error("{0}")]
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
    /// Keeps errors of logs and of rows as separate kinds of errors.
    fn from(error: EstimatorError) -> Self {
        match error {
            EstimatorError::Log(error) => Self::Log(error),
            EstimatorError::Estimation(error) => Self::Estimation(error),
            EstimatorError::Requirement { .. } | EstimatorError::Instruments { .. } => Self::Estimator(error),
        }
    }
}

/// Reason why logs cannot be reduced to triangular factors: a choice needs the samples of all logs.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ReduceError {
    /// `reduce` reads each log alone, so all logs need the same cut-off. Write `cutoff_hz` under
    /// `[motion.differentiator]`, or give a model with `--like`.
    #[error(
        "the cut-off is estimated from the logs and would differ between them: state motion.differentiator.cutoff_hz, or give a model that was identified from some of the logs (--like; in Python like = ..)"
    )]
    Cutoff,
    /// `reduce` reads each log alone, but the automatic test of drive inertia needs all logs. Write `drive_inertia`
    /// under `[drive]`, or give a model with `--like`.
    #[error(
        "the drive inertia of joint {joint} is automatic, which needs all logs: state it (drive.drive_inertia = true or false), or give a model that was identified from some of the logs (--like; in Python like = ..)"
    )]
    DriveInertia {
        /// First such joint.
        joint: String,
    },
    /// `reduce` reads each log alone, but the automatic selection of friction needs all logs. State the laws under
    /// `[drive]`, or give a model with `--like`.
    #[error(
        "the friction of joint {joint} is automatic, which needs all logs: state it (drive.friction = \"stated\" and its terms), or give a model that was identified from some of the logs (--like; in Python like = ..)"
    )]
    Friction {
        /// First such joint.
        joint: String,
    },
    /// The law `load` needs the load of each joint from a previous fit and then the samples again. Factors do not
    /// contain samples: remove the law, or identify from the logs.
    #[error(
        "load-dependent friction cannot be estimated from reduced logs, because its fit reads the samples several times: remove the law `load`, or run `identify` on the complete logs"
    )]
    Load,
    /// Payloads, gains and offsets per log add unknowns for single logs, which factors do not contain. Run `identify`
    /// on the logs.
    #[error("{what} cannot be estimated from reduced logs: identify them from the complete logs")]
    Columns {
        /// Requested columns.
        what: &'static str,
    },
    /// Factors contain sums over the samples, and this estimator needs the samples. Write `estimator.method =
    /// "weighted"` or `"ordinary"`.
    #[error(
        "estimator.method = \"{method}\" cannot use reduced logs, because it reads the samples several times: give \"weighted\" or \"ordinary\""
    )]
    Estimator {
        /// Name of the estimator.
        method: &'static str,
    },
}
