use crate::estimation::estimate::{RunEstimate, identify_runs};
use crate::estimation::forecast::MotionForecast;
use crate::estimation::identify_run::identify_run;
use crate::estimation::lengths::other_length;
use crate::estimation::run_logs::RunLog;
use crate::estimation::run_motion::{RunMotion, legs_along};
use crate::evidence::run_examination::{add_tracking_floors, examined, following_limits};
use crate::planning::planned_run::planned_motion;
use crate::planning::planner::PlannedMotion;
use crate::policy::good_log::GoodLog;
use crate::policy::next_step::{self, RunPlan};
use crate::policy::record::{RunRecord, UsedController};
use crate::policy::supervision::Supervisor;
use crate::robot::{Robot, RobotRun, RunPurpose, RunRequest, StopSignal, read_log_table};
use crate::runs::before_motion::motions;
use crate::runs::commanding::{MotionOutcome, Prepared, folder_number};
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::status::IterationStatus;
use crate::setup::warm_up::{WarmUpWatch, passes};
use crate::storage::cut_short::CutShort;
use crate::storage::store::IterationStore;
use dynident_simulation::Record;
use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

/// The motion of a run: its own trajectories, if they differ from those of the task, and the forecast of the error
/// bars.
#[derive(Clone, Debug, Default)]
pub(crate) struct NextRunMotion {
    pub(crate) motion: Option<RunMotion>,
    pub(crate) forecast: Option<MotionForecast>,
}

pub(crate) enum PlannedRun {
    Run(Box<RunRecord>, Vec<RobotRun>),
    Stopped(IterationStatus),
    CutShort(Vec<RobotRun>, CutShort),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CorrectedLog {
    Run,
    HeldOut,
}

impl Iteration {
    pub(crate) fn next_motion(
        &self,
        records: &[RunRecord],
        store: Option<&IterationStore>,
        stop: Option<&StopSignal>,
    ) -> Result<NextRunMotion, IterationError> {
        let good = records.iter().rev().find(|record| record.accepted && record.estimate.is_some());
        let (Some(planner), Some(good)) = (&self.planner, good) else { return Ok(NextRunMotion::default()) };
        // After a rejected run, the last motion that the robot followed is used.
        if good.run != records.len() {
            return Ok(NextRunMotion { motion: good.motion.clone(), forecast: None });
        }
        let run = records.len() + 1;
        let kept = store.map_or(Ok(None), |store| store.planned(run, self.task.robot.dof()))?;
        let PlannedMotion { motion, forecast } = if let Some(kept) = kept {
            kept
        } else {
            let (task, _) = self.in_force(records)?;
            let planned = planned_motion(&**planner, &task, records, self.settings.pool, stop)?;
            // A plan from an interrupted search is not stored.
            if let Some(store) = store.filter(|_| !stop.is_some_and(StopSignal::is_requested)) {
                store.keep_planned(run, &planned)?;
            }
            planned
        };
        Ok(NextRunMotion { motion: motion.or_else(|| good.motion.clone()), forecast: Some(forecast) })
    }

    /// Returns a run for an additional motion, if the iteration has converged, motions are planned, and the number of
    /// runs permits another one.
    pub(crate) fn further(&self, status: &IterationStatus, records: &[RunRecord]) -> Option<RunPlan> {
        let open = self.planner.is_some() && status.is_converged() && records.len() < self.settings.max_runs;
        open.then(|| next_step::further(records, &self.settings.settled.verdict)).flatten()
    }

    pub(crate) fn made(
        &self,
        robots: &mut [&mut dyn Robot],
        (plan, next): (&RunPlan, NextRunMotion),
        before: &[RunRecord],
        earlier: &[GoodLog],
        supervisor: &mut dyn Supervisor,
        last_motion: &mut Option<Instant>,
    ) -> Result<PlannedRun, IterationError> {
        let legs = legs_along(&self.task, next.motion.as_ref())?;
        let task = &IterationTask { legs: legs.into_owned(), ..self.task.clone() };
        let legs = &task.legs;
        let prepared = match self.prepared(task, plan, before, supervisor.stop())? {
            Ok(prepared) => prepared,
            Err(status) => return Ok(PlannedRun::Stopped(status)),
        };
        let mut runs: Vec<RobotRun> = Vec::with_capacity(legs.len());
        let passes = passes(&self.settings.safety, legs, &prepared.ways, *last_motion);
        let mut warm_up = WarmUpWatch::new(legs, &prepared.ways);
        for motion in motions(task, &self.settings, before, passes) {
            let robot = if robots.len() == 1 { &mut robots[0] } else { &mut robots[motion.place] };
            let with = (task, plan, &prepared);
            let outcome = match self.commanded(*robot, with, &motion, supervisor, last_motion)? {
                MotionOutcome::Run(run) => run,
                MotionOutcome::Stopped(status) => return Ok(PlannedRun::Stopped(status)),
                MotionOutcome::CutShort(run, why) => {
                    runs.extend(run);
                    return Ok(PlannedRun::CutShort(runs, why));
                }
            };
            let done = outcome.status.is_done();
            if !motion.is_run() {
                if !done {
                    let reason = format!(
                        "{} run {} ended early: {}. Check the robot, then repeat the command to restart the run",
                        motion.words(),
                        plan.run,
                        outcome.ending(&*motion.reference()?, self.lowest_oscillation_hz())
                    );
                    return Ok(PlannedRun::Stopped(IterationStatus::Waiting { reason }));
                }
                if let RunPurpose::WarmUp { pass, .. } = motion.purpose {
                    warm_up.add(pass, motion.leg.reference(), &outcome.record);
                }
                continue;
            }
            runs.push(outcome);
            if !done {
                break;
            }
        }
        let mut record = self.recorded(plan, next, prepared.controller.name(), legs, &runs);
        record.rehearsal.clone_from(&prepared.rehearsal);
        record.warm_up = warm_up.shown();
        if record.done {
            let records: Vec<Record> = runs.iter().map(|run| run.record.clone()).collect();
            self.examine(&mut record, &records, before, earlier, &prepared)?;
        } else {
            self.judge(&mut record, before)?;
            let records: Vec<Record> = runs.iter().map(|run| run.record.clone()).collect();
            record.torque_check = self.torque_check(&record, &records, before, &[], &prepared, None)?;
        }
        Ok(PlannedRun::Run(Box::new(record), runs))
    }

    /// Examines a finished run: computes the estimate from the run alone and together with the earlier good runs, and
    /// the evidence in its log.
    fn examine(
        &self,
        record: &mut RunRecord,
        records: &[Record],
        before: &[RunRecord],
        earlier: &[GoodLog],
        prepared: &Prepared,
    ) -> Result<(), IterationError> {
        let fatal = |error: &IterationError| {
            matches!(
                error,
                IterationError::File { .. } | IterationError::State { .. } | IterationError::ChosenFriction { .. }
            )
        };
        let (task, settings) = self.in_force(before)?;
        let legs = self.legs_of(record)?.into_owned();
        let task = IterationTask { legs: legs.clone(), ..task.into_owned() };
        match identify_run(&task, records, &settings) {
            Ok(estimate) => record.estimate = Some(estimate),
            Err(error) if fatal(&error) => return Err(error),
            Err(error) => record.reason = Some(error.to_string()),
        }
        let known = before.iter().rev().find(|record| record.accepted).and_then(RunRecord::knowledge);
        let chosen = record.estimate.as_ref().and_then(|estimate| estimate.differentiator.as_ref());
        let of_run =
            chosen.map_or(Cow::Borrowed(&*settings), |way| Cow::Owned(settings.with_differentiator(&way.taken)));
        let rest_margins = record.estimate.as_ref().map(RunEstimate::rest_margins).unwrap_or_default();
        match examined(&task, records, &of_run, &self.settings.safety.oscillation, known, &rest_margins) {
            Ok(evidence) => record.evidence = Some(evidence),
            Err(error) if fatal(&error) => return Err(error),
            Err(error) => record.reason = record.reason.take().or_else(|| Some(error.to_string())),
        }
        self.judge(record, before)?;
        let Some(own) = record.estimate.clone().filter(|_| record.accepted) else {
            record.torque_check = self.torque_check(record, records, before, earlier, prepared, None)?;
            return Ok(());
        };
        let differentiator = own.differentiator.as_ref().map(|way| &way.taken);
        let run = RunLog {
            run: record.run,
            legs: &legs,
            records,
            joint_sigma: &own.joint_sigma,
            differentiator,
            rest_margins: &own.rest_margins(),
        };
        let before_it = if self.settings.pool { earlier } else { &[] };
        let runs: Vec<RunLog<'_>> = before_it.iter().map(GoodLog::as_run).chain([run]).collect();
        if runs.len() > 1 {
            // If the fit of all runs together fails, the estimate of the newest run is used.
            record.pooled = identify_runs(&task, &runs, &settings).ok().filter(|found| found.impossible.is_none());
        }
        let all: Vec<RunRecord> = before.iter().cloned().chain([record.clone()]).collect();
        let (task, in_force) = self.in_force(&all)?;
        let task = IterationTask { legs: legs.clone(), ..task.into_owned() };
        let after = record.pooled.as_ref().unwrap_or(&own);
        let errors = &record.max_tracking_error_rad;
        // Tracking floor and other link lengths are not evaluated for the first good run.
        let is_judged = known.is_some() && record.controller.model.is_some();
        if let (Some(evidence), true) = (&mut record.evidence, is_judged) {
            add_tracking_floors(evidence, &task, records, &self.settings, after, in_force.friction.before(), errors);
            let thresholds = &self.settings.settled.verdict.lengths;
            evidence.other_length = other_length(&task, &runs, &settings, after, thresholds)?;
        }
        let fitted = Some((&task, &runs[..], &*settings));
        record.torque_check = self.torque_check(record, records, before, earlier, prepared, fitted)?;
        Ok(())
    }

    fn judge(&self, record: &mut RunRecord, before: &[RunRecord]) -> Result<(), IterationError> {
        let names = self.names(&*self.robot(before)?, before)?;
        let following = following_limits(
            &self.legs_of(record)?,
            self.task.robot.dof(),
            self.settings.settled.verdict.following_error_bounds,
        );
        match next_step::verdict(record, before, &self.settings, &following, &names) {
            Ok(()) => record.accepted = true,
            Err(reason) => record.reason = Some(reason.to_string()),
        }
        Ok(())
    }

    fn recorded(&self, plan: &RunPlan, next: NextRunMotion, name: &str, legs: &[Leg], runs: &[RobotRun]) -> RunRecord {
        let joints = self.task.robot.dof();
        let mut worst = vec![0.0_f64; joints];
        for (run, leg) in runs.iter().zip(legs) {
            let own = match &run.truth {
                Some(truth) => truth.max_error.clone(),
                None => run.max_error(leg.reference()),
            };
            worst.iter_mut().zip(own).for_each(|(worst, own)| *worst = worst.max(own));
        }
        let done = runs.len() == legs.len() && runs.iter().all(|run| run.status.is_done());
        RunRecord {
            run: plan.run,
            motion: next.motion,
            forecast: next.forecast,
            controller: UsedController {
                name: name.to_owned(),
                model: plan.model.clone(),
                damping: plan.damping,
                stiffness: plan.stiffness,
            },
            done,
            outcome: runs
                .iter()
                .zip(legs)
                .next_back()
                .map_or_else(String::new, |(run, leg)| run.ending(leg.reference(), self.lowest_oscillation_hz())),
            max_tracking_error_rad: worst,
            accepted: false,
            reason: None,
            rehearsal: None,
            warm_up: None,
            estimate: None,
            pooled: None,
            evidence: None,
            torque_check: None,
            held_out: None,
        }
    }

    /// Returns the log of the newest run that a person has corrected since it was read, if any.
    pub(crate) fn corrected_log(
        &self,
        robots: &[&mut dyn Robot],
        last: &RunRecord,
        store: &IterationStore,
    ) -> Result<Option<CorrectedLog>, IterationError> {
        let joints = self.task.robot.joint_names();
        let is_corrected = |robot: &dyn Robot, purpose: RunPurpose, number: usize, leg: &Leg, path: &Path| {
            let (reference, controller) = (leg.reference(), &self.settings().model_free);
            let name = RunRequest { purpose, ..RunRequest::new(number, reference, controller) }.folder_name();
            let kept = read_log_table(path, &joints, reference.rate_hz()).ok();
            kept.is_some_and(|kept| robot.has_corrected_log(&name, reference, &kept))
        };
        let legs = self.legs_of(last)?;
        for (place, leg) in legs.iter().enumerate() {
            let robot = if robots.len() == 1 { &robots[0] } else { &robots[place] };
            let number = folder_number(last.run, place, legs.len());
            if is_corrected(&**robot, RunPurpose::Run, number, leg, &store.log_path(last.run, place)) {
                return Ok(Some(CorrectedLog::Run));
            }
        }
        let held_out = self.held_out.as_ref().filter(|_| last.held_out.is_some());
        Ok(held_out.and_then(|held_out| {
            let path = store.held_out_log_path(last.run);
            is_corrected(&*robots[0], RunPurpose::HeldOut, last.run, &held_out.leg, &path)
                .then_some(CorrectedLog::HeldOut)
        }))
    }

    /// Returns the logs of the good runs among `records` from the store, for the fit of all runs together.
    pub(crate) fn good_logs(
        &self,
        records: &[RunRecord],
        store: Option<&IterationStore>,
    ) -> Result<Vec<GoodLog>, IterationError> {
        let Some(store) = store.filter(|_| self.settings.pool) else { return Ok(Vec::new()) };
        let good = |record: &&RunRecord| record.accepted && record.estimate.is_some();
        self.logs_of(&records.iter().filter(good).collect::<Vec<_>>(), store)
    }

    pub(crate) fn logs_of(
        &self,
        records: &[&RunRecord],
        store: &IterationStore,
    ) -> Result<Vec<GoodLog>, IterationError> {
        let joints = self.task.robot.joint_names();
        let rates = |record: &RunRecord, legs: &[Leg]| -> Vec<f64> {
            let kept = record.evidence.as_ref().map(|evidence| evidence.log_rates_hz.clone()).unwrap_or_default();
            let of_leg = |(place, leg): (usize, &Leg)| kept.get(place).copied().unwrap_or(leg.reference().rate_hz());
            legs.iter().enumerate().map(of_leg).collect()
        };
        let one = |record: &RunRecord| {
            let legs = self.legs_of(record)?.into_owned();
            let records = store.logs(record.run, &joints, &rates(record, &legs))?;
            Ok(GoodLog::new(record, legs, records))
        };
        records.iter().copied().map(one).collect()
    }
}
