use crate::estimation::estimate::RunEstimate;
use crate::evidence::held_out_motion::{HeldOutMotion, HeldOutRun};
use crate::evidence::run_evidence::RunEvidence;
use crate::evidence::run_examination::examined;
use crate::policy::convergence::UnmetCondition;
use crate::policy::next_step::RunPlan;
use crate::policy::record::RunRecord;
use crate::policy::supervision::Supervisor;
use crate::robot::{Robot, RobotRun, RunPurpose};
use crate::runs::before_motion::Commanded;
use crate::runs::commanding::MotionOutcome;
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::setup::leg::IterationTask;
use crate::setup::settings::RunIdentificationSettings;
use crate::setup::status::IterationStatus;
use crate::storage::cut_short::CutShort;
use dynident_simulation::{SimulationError, require};
use std::borrow::Cow;
use std::time::Instant;

pub(crate) enum HeldOutOutcome {
    Run(HeldOutRun, Box<RobotRun>),
    Stopped(IterationStatus),
    CutShort(Vec<RobotRun>, CutShort),
}

impl Iteration {
    /// Returns the iteration with validation by runs of a held-out motion.
    ///
    /// # Errors
    /// A task with several legs or with windows, a motion with other joints, or `every` = 0.
    pub fn with_held_out(mut self, held_out: HeldOutMotion) -> Result<Self, SimulationError> {
        let legs = &self.task().legs;
        let one = legs.len() == 1 && legs[0].windows().is_none() && held_out.leg.windows().is_none();
        require(one, "legs", legs.len() as f64, "held_out needs a task with one motion and without windows")?;
        dynident_simulation::require_length(
            "joints of the held-out motion",
            self.task().robot.dof(),
            held_out.leg.reference().joints(),
        )?;
        require(held_out.every != Some(0), "held_out.every", 0.0, "give 1 or more, or omit the key")?;
        self.held_out = Some(held_out);
        Ok(self)
    }

    /// Returns the held-out motion if the newest model has to be validated now: after every N runs, and when all
    /// other conditions are met.
    pub(crate) fn held_out_due(&self, records: &[RunRecord]) -> Result<Option<&HeldOutMotion>, IterationError> {
        let (Some(held_out), Some(last)) = (&self.held_out, records.last()) else { return Ok(None) };
        let has_model = last.knowledge().and_then(RunEstimate::for_controller).is_some();
        if !last.accepted || !has_model || last.held_out.is_some() {
            return Ok(None);
        }
        let in_turn = held_out.every.is_some_and(|every| last.run.is_multiple_of(every));
        let due = in_turn || self.shortfalls(records)? == [UnmetCondition::NotHeldOut];
        Ok(due.then_some(held_out))
    }

    pub(crate) fn held_out_made(
        &self,
        held_out: &HeldOutMotion,
        robot: &mut dyn Robot,
        records: &[RunRecord],
        supervisor: &mut dyn Supervisor,
        last_motion: &mut Option<Instant>,
    ) -> Result<HeldOutOutcome, IterationError> {
        let last = records.last();
        let known = last.and_then(RunRecord::knowledge);
        let (Some(last), Some(known)) = (last, known) else {
            let reason = "no model to validate".to_owned();
            return Ok(HeldOutOutcome::Stopped(IterationStatus::Refused { reason }));
        };
        let (run, model) = (last.run, known.for_controller());
        let plan = RunPlan { run, model, damping: 1.0, stiffness: 1.0 };
        let task = IterationTask { legs: vec![held_out.leg.clone()], ..self.task().clone() };
        let prepared = match self.prepared(&task, &plan, records, supervisor.stop())? {
            Ok(prepared) => prepared,
            Err(status) => return Ok(HeldOutOutcome::Stopped(status)),
        };
        let motion = Commanded { place: 0, leg: &task.legs[0], speed: 1.0, purpose: RunPurpose::HeldOut };
        let robot_run = match self.commanded(robot, (&task, &plan, &prepared), &motion, supervisor, last_motion)? {
            MotionOutcome::Run(robot_run) => robot_run,
            MotionOutcome::Stopped(status) => return Ok(HeldOutOutcome::Stopped(status)),
            MotionOutcome::CutShort(part, why) => return Ok(HeldOutOutcome::CutShort(part.into_iter().collect(), why)),
        };
        let (evidence, reason) = if robot_run.status.is_done() {
            match self.held_out_evidence(held_out, &robot_run, records, known) {
                Ok(evidence) => (Some(evidence), None),
                Err(error) => (None, Some(error.to_string())),
            }
        } else {
            (None, None)
        };
        let max_tracking_error_rad = match &robot_run.truth {
            Some(truth) => truth.max_error.clone(),
            None => robot_run.max_error(held_out.leg.reference()),
        };
        let found = HeldOutRun {
            done: robot_run.status.is_done(),
            outcome: robot_run.ending(held_out.leg.reference(), self.lowest_oscillation_hz()),
            max_tracking_error_rad,
            evidence,
            reason,
        };
        Ok(HeldOutOutcome::Run(found, Box::new(robot_run)))
    }

    fn held_out_evidence(
        &self,
        held_out: &HeldOutMotion,
        robot_run: &RobotRun,
        records: &[RunRecord],
        known: &RunEstimate,
    ) -> Result<RunEvidence, IterationError> {
        let (task, settings) = self.in_force(records)?;
        let task = IterationTask { legs: vec![held_out.leg.clone()], ..task.into_owned() };
        let settings = held_out_settings(&settings, records);
        let own = records.last().and_then(|record| record.estimate.as_ref());
        let rest_margins = own.map(RunEstimate::rest_margins).unwrap_or_default();
        let oscillation = &self.settings().safety.oscillation;
        examined(&task, core::slice::from_ref(&robot_run.record), &settings, oscillation, Some(known), &rest_margins)
    }
}

/// Settings for the log of a held-out motion: those of the last run, with the differentiator that was selected for
/// it.
pub(crate) fn held_out_settings<'a>(
    settings: &'a RunIdentificationSettings,
    records: &[RunRecord],
) -> Cow<'a, RunIdentificationSettings> {
    let way = records.iter().rev().find_map(|record| record.estimate.as_ref()?.differentiator.as_ref());
    way.map_or(Cow::Borrowed(settings), |way| Cow::Owned(settings.with_differentiator(&way.taken)))
}
