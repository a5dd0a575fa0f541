//! The robot that all good runs tell: a task for the whole identification.

use crate::drive::Iteration;
use crate::error::IterationError;
use crate::good_log::GoodLog;
use crate::record::RunRecord;
use crate::run_logs::{identification_settings, recordings};
use crate::store::IterationStore;
use dynident_identification::IdentificationTask;
use dynident_identification::friction::JointFriction;

impl Iteration {
    /// What [`identify`](dynident_identification::identify()) makes the iteration's result of: the logs of all good
    /// runs in the store (of the last where runs are not pooled), each weighted by its own noise, all joints at once
    /// whatever the scheme, nothing held. `None` without a good run.
    ///
    /// # Errors
    /// Logs that are not in the store any more, records of another robot.
    pub fn identification_task(
        &self,
        records: &[RunRecord],
        store: &IterationStore,
    ) -> Result<Option<IdentificationTask>, IterationError> {
        let good: Vec<&RunRecord> = records.iter().filter(|record| record.accepted).collect();
        let chosen = if self.settings().pool { &good[..] } else { &good[good.len().saturating_sub(1)..] };
        if chosen.is_empty() {
            return Ok(None);
        }
        let logs = self.logs_of(chosen, store)?;
        let runs: Vec<_> = logs.iter().map(GoodLog::as_run).collect();
        let (task, settings) = self.in_force(records)?;
        let recordings = recordings(&task, &runs, &settings)?;
        let mut identification = IdentificationTask::new(task.robot.clone(), recordings);
        identification.payloads.clone_from(&settings.payloads);
        identification.settings = identification_settings(&task, &settings, runs.len());
        identification.settings.estimation.held.clear();
        Ok(Some(identification))
    }
}

/// The friction that a run chose for itself and those after it; empty where it was stated.
pub fn friction_chosen(records: &[RunRecord]) -> Vec<JointFriction> {
    let choices = records.iter().filter_map(|record| Some(&record.estimate.as_ref()?.friction));
    choices.into_iter().find(|choice| !choice.is_empty()).cloned().unwrap_or_default()
}
