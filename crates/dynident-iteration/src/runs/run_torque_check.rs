use crate::estimation::run_logs::RunLog;
use crate::policy::good_log::GoodLog;
use crate::policy::record::RunRecord;
use crate::runs::commanding::Prepared;
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::settings::RunIdentificationSettings;
use crate::torque_check::{CheckWith, CheckedRun, LeastDeviation, TorqueCheck, check_torque, row_scales};
use dynident_simulation::Record;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};

pub(crate) type Fitted<'a> = (&'a IterationTask, &'a [RunLog<'a>], &'a RunIdentificationSettings);

impl Iteration {
    /// Compares the logged torque of a run with the torque that its controller commanded; `fitted` are the inputs of
    /// its fit, if it was fitted.
    pub(crate) fn torque_check(
        &self,
        record: &RunRecord,
        records: &[Record],
        before: &[RunRecord],
        earlier: &[GoodLog],
        prepared: &Prepared,
        fitted: Option<Fitted<'_>>,
    ) -> Result<Option<TorqueCheck>, IterationError> {
        let Some(settings) = &self.settings.torque_check else { return Ok(None) };
        let least = LeastDeviation { share: 0.01 * settings.row_scale_percent, sigmas: settings.sigmas };
        let scales = match (fitted, record.knowledge()) {
            (Some((task, runs, of_fit)), Some(known)) => row_scales(task, runs, of_fit, known, least)?,
            _ => vec![None; self.task.robot.dof()],
        };
        let models: Vec<Option<(ControllerSettings, Option<ControllerModel>)>> =
            earlier.iter().map(|log| self.of_earlier(log, before)).collect::<Result<_, IterationError>>()?;
        let earlier_runs = earlier.iter().zip(&models).filter_map(|(log, own)| {
            let (controller, model) = own.as_ref()?;
            let RunLog { legs, records, .. } = log.as_run();
            Some(CheckedRun { legs, records, controller, model: model.as_ref() })
        });
        let legs: Vec<Leg> = self.legs_of(record)?.into_owned();
        let (controller, model) = (&prepared.controller, prepared.model.as_ref());
        // A run that ended early can have fewer records than trajectories.
        let newest = CheckedRun { legs: &legs, records, controller, model };
        let runs: Vec<CheckedRun<'_>> = earlier_runs.chain([newest]).collect();
        let feeds_forward_later =
            matches!(&self.settings.controller, ControllerSettings::PositionLoop(own) if own.feed_forward);
        let with = CheckWith {
            settings,
            identification: &self.settings.identification,
            row_scales: &scales,
            most_lag_s: self.settings.settled.most_lag_s(self.task.robot.model()),
            feeds_forward_later,
            ended_early: !record.done,
        };
        Ok(check_torque(&self.task, &runs, &with))
    }

    fn of_earlier(
        &self,
        log: &GoodLog,
        before: &[RunRecord],
    ) -> Result<Option<(ControllerSettings, Option<ControllerModel>)>, IterationError> {
        let Some(place) = before.iter().position(|record| record.run == log.run()) else { return Ok(None) };
        let Some(parameters) = &before[place].controller.model else {
            return Ok(Some((self.settings.model_free.clone(), None)));
        };
        let model = self.controller_model(&before[..place], parameters)?;
        let first = self.settings.first.as_ref().filter(|_| log.run() == 1);
        Ok(Some((first.unwrap_or(&self.settings.controller).clone(), Some(model))))
    }
}
