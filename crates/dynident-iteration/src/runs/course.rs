use crate::estimation::forecast::MotionForecast;
use crate::evidence::held_out_motion::HeldOutMotion;
use crate::policy::convergence::UnmetCondition;
use crate::policy::good_log::GoodLog;
use crate::policy::next_step::{Next, RunPlan};
use crate::policy::record::RunRecord;
use crate::policy::supervision::{Supervisor, Watching};
use crate::robot::{Robot, RobotRun, StopSignal};
use crate::runs::drive::{CorrectedLog, NextRunMotion, PlannedRun};
use crate::runs::held_out::HeldOutOutcome;
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::setup::status::IterationStatus;
use crate::storage::store::IterationStore;
use dynident_simulation::require_length;
use std::time::Instant;

/// The result of an iteration.
#[derive(Clone, Debug, PartialEq)]
pub struct IterationOutcome {
    /// How the iteration ended.
    pub status: IterationStatus,
    /// Conditions of convergence that are not met; empty if the iteration has converged.
    pub shortfalls: Vec<UnmetCondition>,
    /// All runs, in order.
    pub runs: Vec<RunRecord>,
    /// Forecast for a further run, if all conditions are met and the forecast gain was too small.
    pub declined: Option<MotionForecast>,
}

/// Runs, identifies and repeats until tracking and parameters have converged. The first run uses a controller without
/// a model, or with the nominal model; later runs use the model-based controller with the newest estimate. A run that
/// is worse (worse tracking, a violated limit, divergence) is rejected, and the change from the last good parameters
/// to the new ones is halved. If that does not help, the iteration uses the controller without a model again, with
/// higher gains.
///
/// `robots` contains one robot for all trajectories, or one per trajectory. With a `store`, stored runs are not
/// repeated, and each new run is stored before the next begins. `watch` is called after every new run.
///
/// # Errors
/// Settings that do not fit together, files that cannot be written. Faults of the robot are reported in the records and
/// the status.
pub fn iterate(
    iteration: &Iteration,
    robots: &mut [&mut dyn Robot],
    store: Option<&IterationStore>,
    watch: &mut dyn FnMut(&RunRecord, &[RobotRun]),
) -> Result<IterationOutcome, IterationError> {
    iterate_supervised(iteration, robots, store, &mut Watching(watch))
}

/// Like [`iterate()`], with a supervisor, who can stop the iteration and must permit every motion. A run that is
/// stopped is not used: its log is kept in a separate folder, and the next call repeats the run.
///
/// # Errors
/// Same as for [`iterate()`].
pub fn iterate_supervised(
    iteration: &Iteration,
    robots: &mut [&mut dyn Robot],
    store: Option<&IterationStore>,
    supervisor: &mut dyn Supervisor,
) -> Result<IterationOutcome, IterationError> {
    let legs = iteration.task.legs.len();
    if robots.len() != 1 {
        require_length("robots", legs, robots.len())?;
    }
    let records = known_records(iteration, robots, store)?;
    let mut course = Course { iteration, store, records, good: None, stopped: None, last_motion: None };
    loop {
        if let Some(status) = course.waits(supervisor)? {
            return course.outcome(status);
        }
        // The newest model is validated before it is used further.
        if let Some(held_out) = iteration.held_out_due(&course.records)? {
            if let Some(status) = course.run_held_out(held_out, &mut *robots[0], supervisor)? {
                return course.outcome(status);
            }
            continue;
        }
        let stop = supervisor.stop().cloned();
        let (plan, next) = match course.next(stop.as_ref())? {
            NextStep::Run(plan, next) => (plan, next),
            NextStep::Finished(status) => return course.outcome(status),
            NextStep::Declined(status, declined) => {
                return Ok(IterationOutcome { declined, ..course.outcome(status)? });
            }
        };
        if let Some(status) = course.run(robots, &plan, next, supervisor)? {
            return course.outcome(status);
        }
    }
}

/// Returns the records of earlier calls, except those whose logs were corrected since.
fn known_records(
    iteration: &Iteration,
    robots: &[&mut dyn Robot],
    store: Option<&IterationStore>,
) -> Result<Vec<RunRecord>, IterationError> {
    let Some(store) = store else { return Ok(Vec::new()) };
    let mut records = store.records()?;
    if let Some(last) = records.last()
        && let Some(corrected) = iteration.corrected_log(robots, last, store)?
    {
        match corrected {
            CorrectedLog::Run => store.forget_run(last.run)?,
            CorrectedLog::HeldOut => store.forget_held_out(last.run)?,
        }
        records = store.records()?;
    }
    let robot = iteration.robot(&records)?;
    for record in &records {
        record.check(&robot).map_err(|problem| store.refused(record.run, problem))?;
    }
    Ok(records)
}

enum NextStep {
    Run(RunPlan, NextRunMotion),
    Finished(IterationStatus),
    /// All conditions are met, and the forecast gain of a further run is too small.
    Declined(IterationStatus, Option<MotionForecast>),
}

struct Course<'a> {
    iteration: &'a Iteration,
    store: Option<&'a IterationStore>,
    records: Vec<RunRecord>,
    /// Logs of the good runs, loaded when first needed.
    good: Option<Vec<GoodLog>>,
    stopped: Option<String>,
    last_motion: Option<Instant>,
}

impl Course<'_> {
    fn outcome(self, status: IterationStatus) -> Result<IterationOutcome, IterationError> {
        let shortfalls = self.iteration.shortfalls(&self.records)?;
        Ok(IterationOutcome { status, shortfalls, runs: self.records, declined: None })
    }

    /// Returns the waiting status if a person has to check the robot before the next run.
    fn waits(&self, supervisor: &dyn Supervisor) -> Result<Option<IterationStatus>, IterationError> {
        let Some(why) = self.stopped.as_ref().filter(|_| self.iteration.settings.safety.outside && !supervisor.asks())
        else {
            return Ok(None);
        };
        let next = self.records.len() + 1;
        let reason = format!("{why}. Check the robot, then repeat the command to continue with run {next}");
        let is_finished = matches!(self.iteration.next(&self.records)?, Next::Finished(_));
        Ok((!is_finished).then_some(IterationStatus::Waiting { reason }))
    }

    fn run_held_out(
        &mut self,
        held_out: &HeldOutMotion,
        robot: &mut dyn Robot,
        supervisor: &mut dyn Supervisor,
    ) -> Result<Option<IterationStatus>, IterationError> {
        let run = self.records.len();
        let outcome =
            self.iteration.held_out_made(held_out, robot, &self.records, supervisor, &mut self.last_motion)?;
        match outcome {
            HeldOutOutcome::Stopped(status) => Ok(Some(status)),
            HeldOutOutcome::CutShort(runs, why) => {
                let next = format!("the held-out run after run {run}");
                why.kept(self.store, run, &runs, &next).map(Some)
            }
            HeldOutOutcome::Run(found, robot_run) => {
                if let (Some(store), Some(last)) = (self.store, self.records.last()) {
                    store.keep_held_out(last.run, &found, &robot_run)?;
                }
                self.stopped =
                    (!found.done).then(|| format!("the held-out run after run {run} ended early: {}", found.outcome));
                if let Some(last) = self.records.last_mut() {
                    last.held_out = Some(found);
                }
                Ok(None)
            }
        }
    }

    fn next(&self, stop: Option<&StopSignal>) -> Result<NextStep, IterationError> {
        let (iteration, records) = (self.iteration, &self.records);
        match iteration.next(records)? {
            Next::Run(plan) => Ok(NextStep::Run(plan, iteration.next_motion(records, self.store, stop)?)),
            Next::Finished(status) => {
                let Some(plan) = iteration.further(&status, records) else { return Ok(NextStep::Finished(status)) };
                let next = iteration.next_motion(records, self.store, stop)?;
                if stop.is_some_and(StopSignal::is_requested) {
                    let reason = format!("during the search for the motion of run {}", plan.run);
                    return Ok(NextStep::Finished(IterationStatus::Interrupted { reason }));
                }
                if !next.forecast.as_ref().is_some_and(|forecast| forecast.worth_a_run) {
                    return Ok(NextStep::Declined(status, next.forecast));
                }
                Ok(NextStep::Run(plan, next))
            }
        }
    }

    fn run(
        &mut self,
        robots: &mut [&mut dyn Robot],
        plan: &RunPlan,
        next: NextRunMotion,
        supervisor: &mut dyn Supervisor,
    ) -> Result<Option<IterationStatus>, IterationError> {
        let Self { iteration, store, records, .. } = self;
        // The logs are loaded only now, because an iteration that has ended needs none.
        let good = match &mut self.good {
            Some(good) => good,
            None => self.good.insert(iteration.good_logs(records, *store)?),
        };
        match iteration.made(robots, (plan, next), records, good, supervisor, &mut self.last_motion)? {
            PlannedRun::Stopped(status) => Ok(Some(status)),
            PlannedRun::CutShort(runs, why) => {
                let next = format!("run {}", plan.run);
                why.kept(*store, plan.run, &runs, &next).map(Some)
            }
            PlannedRun::Run(record, runs) => {
                if record.accepted && record.estimate.is_some() && iteration.settings.pool {
                    let legs = iteration.legs_of(&record)?.into_owned();
                    good.push(GoodLog::new(&record, legs, runs.iter().map(|run| run.record.clone()).collect()));
                }
                if let Some(store) = store {
                    store.keep(&record, &runs)?;
                }
                supervisor.made(&record, &runs);
                self.stopped = (!record.done).then(|| format!("run {} ended early: {}", record.run, record.outcome));
                records.push(*record);
                Ok(None)
            }
        }
    }
}
