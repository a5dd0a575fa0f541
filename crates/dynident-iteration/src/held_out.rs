//! Runs of another motion, which are never fitted: what the newest model is judged by.

use crate::before_motion::Commanded;
use crate::commanding::Came;
use crate::convergence::Shortfall;
use crate::cut_short::CutShort;
use crate::error::IterationError;
use crate::estimate::RunEstimate;
use crate::evidence::RunEvidence;
use crate::held_out_motion::{HeldOutMotion, HeldOutRun};
use crate::iteration::Iteration;
use crate::leg::IterationTask;
use crate::policy::RunPlan;
use crate::record::RunRecord;
use crate::robot::{Robot, RobotRun, RunPurpose};
use crate::run_examination::examined;
use crate::settings::RunIdentificationSettings;
use crate::status::IterationStatus;
use crate::supervision::Supervisor;
use dynident_simulation::{SimulationError, require};
use std::borrow::Cow;
use std::time::Instant;

/// What came of a held-out run.
pub(crate) enum HeldOutCame {
    Run(HeldOutRun, Box<RobotRun>),
    Stopped(IterationStatus),
    CutShort(Vec<RobotRun>, CutShort),
}

impl Iteration {
    /// The same, judged by runs of a motion that is never fitted.
    ///
    /// # Errors
    /// A task of several legs, or of one of which not everything counts; a motion of other joints; every no run.
    pub fn with_held_out(mut self, held_out: HeldOutMotion) -> Result<Self, SimulationError> {
        let legs = &self.task().legs;
        let one = legs.len() == 1 && legs[0].windows().is_none() && held_out.leg.windows().is_none();
        require(one, "legs", legs.len() as f64, "held_out needs one motion of which everything counts")?;
        dynident_simulation::require_length(
            "joints of the held-out motion",
            self.task().robot.dof(),
            held_out.leg.reference().joints(),
        )?;
        require(held_out.every != Some(0), "held_out.every", 0.0, "give 1 or more, or leave it out")?;
        self.held_out = Some(held_out);
        Ok(self)
    }

    /// Whether the newest model has to be judged before anything else comes: after every so many runs, and where
    /// nothing else is missing.
    pub(crate) fn held_out_due(&self, records: &[RunRecord]) -> Result<Option<&HeldOutMotion>, IterationError> {
        let (Some(held_out), Some(last)) = (&self.held_out, records.last()) else { return Ok(None) };
        let has_model = last.knowledge().and_then(RunEstimate::for_controller).is_some();
        if !last.accepted || !has_model || last.held_out.is_some() {
            return Ok(None);
        }
        let in_turn = held_out.every.is_some_and(|every| last.run.is_multiple_of(every));
        let due = in_turn || self.shortfalls(records)? == [Shortfall::NotHeldOut];
        Ok(due.then_some(held_out))
    }

    /// Makes a held-out run after the last of `records`.
    pub(crate) fn held_out_made(
        &self,
        held_out: &HeldOutMotion,
        robot: &mut dyn Robot,
        records: &[RunRecord],
        supervisor: &mut dyn Supervisor,
        last_motion: &mut Option<Instant>,
    ) -> Result<HeldOutCame, IterationError> {
        let last = records.last();
        let known = last.and_then(RunRecord::knowledge);
        let (Some(last), Some(known)) = (last, known) else {
            let reason = "no model to judge".to_owned();
            return Ok(HeldOutCame::Stopped(IterationStatus::Refused { reason }));
        };
        let (run, model) = (last.run, known.for_controller());
        let plan = RunPlan { run, model, damping: 1.0, stiffness: 1.0 };
        let task = IterationTask { legs: vec![held_out.leg.clone()], ..self.task().clone() };
        let prepared = match self.prepared(&task, &plan, records, supervisor.stop())? {
            Ok(prepared) => prepared,
            Err(status) => return Ok(HeldOutCame::Stopped(status)),
        };
        let motion = Commanded { place: 0, leg: &task.legs[0], speed: 1.0, purpose: RunPurpose::HeldOut };
        let came = match self.commanded(robot, (&task, &plan, &prepared), &motion, supervisor, last_motion)? {
            Came::Run(came) => came,
            Came::Stopped(status) => return Ok(HeldOutCame::Stopped(status)),
            Came::CutShort(came, why) => return Ok(HeldOutCame::CutShort(came.into_iter().collect(), why)),
        };
        let (evidence, reason) = if came.status.is_done() {
            match self.held_out_evidence(held_out, &came, records, known) {
                Ok(evidence) => (Some(evidence), None),
                Err(error) => (None, Some(error.to_string())),
            }
        } else {
            (None, None)
        };
        let max_tracking_error_rad = match &came.truth {
            Some(truth) => truth.max_error.clone(),
            None => came.max_error(held_out.leg.reference()),
        };
        let found = HeldOutRun {
            done: came.status.is_done(),
            outcome: came.ending(held_out.leg.reference(), self.lowest_oscillation_hz()),
            max_tracking_error_rad,
            evidence,
            reason,
        };
        Ok(HeldOutCame::Run(found, Box::new(came)))
    }

    /// What its log shows, by the same identification as of runs.
    fn held_out_evidence(
        &self,
        held_out: &HeldOutMotion,
        came: &RobotRun,
        records: &[RunRecord],
        known: &RunEstimate,
    ) -> Result<RunEvidence, IterationError> {
        let (task, settings) = self.in_force(records)?;
        let task = IterationTask { legs: vec![held_out.leg.clone()], ..task.into_owned() };
        let settings = held_out_settings(&settings, records);
        let own = records.last().and_then(|record| record.estimate.as_ref());
        let rest_margins = own.map(RunEstimate::rest_margins).unwrap_or_default();
        let oscillation = &self.settings().safety.oscillation;
        examined(&task, core::slice::from_ref(&came.record), &settings, oscillation, Some(known), &rest_margins)
    }
}

/// How a held-out log is read: as that of the last run, with the differentiator that it chose.
pub(crate) fn held_out_settings<'a>(
    settings: &'a RunIdentificationSettings,
    records: &[RunRecord],
) -> Cow<'a, RunIdentificationSettings> {
    let way = records.iter().rev().find_map(|record| record.estimate.as_ref()?.differentiator.as_ref());
    way.map_or(Cow::Borrowed(settings), |way| Cow::Owned(settings.with_differentiator(&way.taken)))
}
