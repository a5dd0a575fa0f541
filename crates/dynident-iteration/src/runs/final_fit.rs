use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_logs::{RunLog, identification_settings, recordings as recordings_of};
use crate::policy::good_log::GoodLog;
use crate::policy::record::RunRecord;
use crate::runs::held_out::held_out_settings;
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::storage::store::IterationStore;
use dynident_identification::{IdentificationTask, OffsetChoice, Role};

impl Iteration {
    /// Returns the task with which [`identify`](dynident_identification::identify()) computes the result of the
    /// iteration. It contains the logs of all good runs in the store (only the last if runs are not fitted together),
    /// each weighted by its own noise. All joints are fitted at once, and no parameter is fixed. `None` without a
    /// good run.
    ///
    /// # Errors
    /// Logs that are missing in the store, records of another robot.
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
        let recordings = recordings_of(&task, &runs, &settings)?;
        let mut identification = IdentificationTask::new(task.robot.clone(), recordings);
        identification.payloads.clone_from(&settings.payloads);
        identification.settings = identification_settings(&task, &settings, runs.len());
        identification.settings.estimation.held.clear();
        let own_offsets =
            good.last().and_then(|last| last.pooled.as_ref()).is_some_and(|all| !all.run_offsets.is_empty());
        if own_offsets && self.settings().pool {
            identification.settings.offsets = OffsetChoice::PerLog;
        }
        if let Some(held_out) = &self.held_out {
            let joints = task.robot.joint_names();
            let settings = held_out_settings(&settings, records);
            for record in records.iter().filter(|record| record.accepted) {
                let Some(evidence) = record.held_out.as_ref().and_then(|run| run.evidence.as_ref()) else { continue };
                let rate_hz = evidence.log_rates_hz.first().copied().unwrap_or(held_out.leg.reference().rate_hz());
                let log = [store.held_out_log(record.run, &joints, rate_hz)?];
                let legs = core::slice::from_ref(&held_out.leg);
                let own = record.estimate.as_ref().map(RunEstimate::rest_margins).unwrap_or_default();
                let (run, records, joint_sigma, rest_margins) = (record.run, &log[..], &[][..], &own[..]);
                let run = RunLog { run, legs, records, joint_sigma, differentiator: None, rest_margins };
                for mut recording in recordings_of(&task, &[run], &settings)? {
                    recording.role = Role::Validate;
                    recording.name = format!("run {}, held out", record.run);
                    identification.recordings.push(recording);
                }
            }
        }
        Ok(Some(identification))
    }
}
