//! Check whether logs can be reduced to triangular factors: no choice may need the samples of all logs.

use crate::error::ReduceError;
use crate::estimators::Estimator;
use crate::settings::{GainChoice, IdentificationSettings, OffsetChoice};
use dynident_rows::RegressorModel;

pub(crate) fn is_reducible(model: &RegressorModel, settings: &IdentificationSettings) -> Result<(), ReduceError> {
    if let Some(search) = settings.friction.searches().first() {
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
