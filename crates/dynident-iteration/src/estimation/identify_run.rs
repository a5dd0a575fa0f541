use crate::estimation::differentiator_choice::choose_differentiator;
use crate::estimation::estimate::RunEstimate;
use crate::estimation::far_from_rest::without_near_rest;
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::RunIdentificationSettings;
use dynident_simulation::Record;

/// Estimates the base parameters from the records of one run (one record per trajectory of the task), with the same
/// identification as for any log ([`dynident_identification`]). Only rows inside the time windows are used; joints
/// without rows are omitted; known columns are fixed. The differentiator is selected if the settings request it. Rows
/// near rest are excluded for joints whose residual they increase ([`SamplesNearRest`](crate::SamplesNearRest)).
///
/// # Errors
/// Records that do not belong to the task, a differentiator that cannot be applied, rows that are not sufficient for an
/// estimate. A missing physically consistent model is part of the result, not an error.
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
