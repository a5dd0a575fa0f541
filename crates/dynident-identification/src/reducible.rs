//! Whether logs can be reduced to factors: nothing may be left that is chosen by looking at the samples of all of them.

use crate::estimators::Estimator;
use crate::regressor_model::RegressorModel;
use crate::settings::{GainChoice, IdentificationSettings, OffsetChoice};
use thiserror::Error;

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

/// Whether all that makes rows is stated.
pub(crate) fn is_reducible(model: &RegressorModel, settings: &IdentificationSettings) -> Result<(), ReduceError> {
    if let Some(search) = settings.friction.first() {
        return Err(ReduceError::Friction { joint: search.joint.clone() });
    }
    if settings.motion.differentiator.wants_cutoff() {
        return Err(ReduceError::Cutoff);
    }
    if let Some(joint) = settings.drive_inertia.first() {
        return Err(ReduceError::DriveInertia { joint: joint.clone() });
    }
    if model.needs_load() {
        return Err(ReduceError::Load);
    }
    if settings.gains == GainChoice::Unknown {
        return Err(ReduceError::Columns { what: "unknown gains" });
    }
    if settings.offsets == OffsetChoice::PerLog {
        return Err(ReduceError::Columns { what: "offsets of single logs" });
    }
    match &settings.estimation.estimator {
        Estimator::Ordinary | Estimator::Weighted | Estimator::Auto(_) => Ok(()),
        other => Err(ReduceError::Estimator { method: other.name() }),
    }
}
