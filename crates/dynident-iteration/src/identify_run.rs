//! The identification of one run.

use crate::differentiator_choice::choose_differentiator;
use crate::error::IterationError;
use crate::estimate::RunEstimate;
use crate::far_from_rest::without_near_rest;
use crate::leg::IterationTask;
use crate::settings::RunIdentificationSettings;
use dynident_simulation::Record;

/// Base parameters from the records of one run, one record for each leg of the task: the same identification as of any
/// log ([`dynident_identification`]), on records in memory. Rows count within the windows; joints without rows are left
/// out; known columns are held. The differentiator is chosen where the settings leave it to the run, and rows near rest
/// count where friction explains them ([`NearRest`](crate::NearRest)).
///
/// # Errors
/// Records that do not belong to the task, a differentiator that cannot be applied, rows that do not carry an estimate.
/// That there is no consistent set is part of the result.
pub fn identify_run(
    task: &IterationTask,
    records: &[Record],
    settings: &RunIdentificationSettings,
) -> Result<RunEstimate, IterationError> {
    if !settings.choose_differentiator {
        return without_near_rest(task, records, settings);
    }
    let choice = choose_differentiator(task, records, settings)?;
    let found = without_near_rest(task, records, &settings.with_differentiator(&choice.taken))?;
    Ok(RunEstimate { differentiator: Some(choice), ..found })
}
