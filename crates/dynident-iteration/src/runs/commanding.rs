use crate::estimation::estimate::RunEstimate;
use crate::evidence::expected_torque::expected_torque;
use crate::policy::next_step::RunPlan;
use crate::policy::record::RunRecord;
use crate::policy::supervision::{BegunMotion, Supervisor};
use crate::robot::{Robot, RobotRun, RobotStatus, RunRequest, StopSignal};
use crate::runs::before_motion::{Commanded, Planned, next_motion, rehearsed, ways_of};
use crate::runs::iteration::Iteration;
use crate::setup::error::IterationError;
use crate::setup::home::{FoundPaths, HomeError};
use crate::setup::leg::IterationTask;
use crate::setup::rehearsal::{Rehearsal, RehearsalFailure};
use crate::setup::status::IterationStatus;
use crate::storage::cut_short::CutShort;
use dynident_dynamics::ParametricModel;
use dynident_simulation::controllers::{ControllerModel, ControllerSettings};
use std::time::Instant;

#[derive(Debug)]
pub(crate) struct Prepared {
    pub(crate) controller: ControllerSettings,
    pub(crate) model: Option<ControllerModel>,
    pub(crate) ways: Vec<Option<FoundPaths>>,
    pub(crate) rehearsal: Option<Rehearsal>,
    /// The newest estimate with its model, for an observer.
    known: Option<(ParametricModel, RunEstimate)>,
}

pub(crate) enum MotionOutcome {
    Run(RobotRun),
    Stopped(IterationStatus),
    /// The motion was interrupted or failed: its log if the motion had begun, and the reason.
    CutShort(Option<RobotRun>, CutShort),
}

/// Number of a trajectory of a run. It determines the seed of the noise and the name of the folder.
pub(crate) fn folder_number(run: usize, place: usize, legs: usize) -> usize {
    (run - 1) * legs + place + 1
}

impl Iteration {
    /// Prepares controller, model, paths and rehearsal of a plan along the trajectories of `task`, or returns why the
    /// plan is not commanded.
    pub(crate) fn prepared(
        &self,
        task: &IterationTask,
        plan: &RunPlan,
        before: &[RunRecord],
        stop: Option<&StopSignal>,
    ) -> Result<Result<Prepared, IterationStatus>, IterationError> {
        let settings = self.settings();
        let controller = plan.controller(settings);
        let model = plan.model.as_ref().map(|parameters| self.controller_model(before, parameters)).transpose()?;
        let robot = self.robot(before)?;
        let refused = |why: &dyn core::fmt::Display| {
            let reason = format!("run {} is not commanded: {why}", plan.run);
            Ok(Err(IterationStatus::Refused { reason }))
        };
        let interrupted = || {
            let reason = format!("while run {} was prepared", plan.run);
            Ok(Err(IterationStatus::Interrupted { reason }))
        };
        let stopped = || stop.is_some_and(StopSignal::is_requested);
        let ways = match ways_of(task, settings, &stopped) {
            Ok(ways) => ways,
            Err(HomeError::Numbers(error)) => return Err(error.into()),
            Err(HomeError::Interrupted) => return interrupted(),
            Err(error) => return refused(&error),
        };
        let planned = Planned { plan, controller: &controller, model: model.as_ref(), ways: &ways };
        match rehearsed(task, settings, &robot, &planned, before, &stopped)? {
            Ok(rehearsal) => {
                let known = before.iter().rev().find(|record| record.accepted).and_then(RunRecord::knowledge);
                let known = known.map(|known| (robot.into_owned(), known.clone()));
                Ok(Ok(Prepared { controller, model, ways, rehearsal, known }))
            }
            Err(RehearsalFailure::Interrupted) => interrupted(),
            Err(failure) => refused(&failure),
        }
    }

    pub(crate) fn commanded(
        &self,
        robot: &mut dyn Robot,
        (task, plan, prepared): (&IterationTask, &RunPlan, &Prepared),
        motion: &Commanded<'_>,
        supervisor: &mut dyn Supervisor,
        last_motion: &mut Option<Instant>,
    ) -> Result<MotionOutcome, IterationError> {
        let Commanded { place, speed, purpose, .. } = *motion;
        let Prepared { controller, model, ways, rehearsal, known } = prepared;
        let run = folder_number(plan.run, place, task.legs.len());
        let reference = &*motion.reference()?;
        let found = ways[place].as_ref();
        let own = found.map(|found| if speed < 1.0 { found.ways.slowed(speed) } else { Ok(found.ways.clone()) });
        let own = own.transpose()?;
        let stop = supervisor.stop().cloned();
        let stop_requested = || stop.as_ref().is_some_and(StopSignal::is_requested);
        if stop_requested() {
            return Ok(MotionOutcome::CutShort(None, CutShort::Interrupted("between two runs".to_owned())));
        }
        let mut shown = next_motion(task, plan, controller, motion, reference, own.as_ref().zip(found));
        shown.rehearsal.clone_from(rehearsal);
        if !supervisor.allows(&shown) {
            if stop_requested() {
                return Ok(MotionOutcome::CutShort(None, CutShort::Interrupted("before a run".to_owned())));
            }
            let reason = format!("run {} was not allowed", plan.run);
            return Ok(MotionOutcome::Stopped(IterationStatus::Waiting { reason }));
        }
        let observed = supervisor.observer().is_some();
        if observed {
            let expected = known.as_ref().map(|(model, known)| expected_torque(model, known, reference));
            supervisor.begins(&BegunMotion { motion: &shown, reference, expected: expected.as_ref() });
        }
        let robot_run = robot.run(&RunRequest {
            model: model.as_ref(),
            envelope: self.settings().safety.envelope.as_ref(),
            oscillation: self.settings().safety.oscillation.limits(self.task().robot.model()),
            stop: stop.as_ref(),
            observer: supervisor.observer(),
            speed,
            purpose,
            ways: own.as_ref(),
            ..RunRequest::new(run, reference, controller)
        })?;
        *last_motion = Some(Instant::now());
        if observed {
            supervisor.ended(&robot_run);
        }
        Ok(MotionOutcome::of(robot_run, plan.run))
    }
}

impl MotionOutcome {
    /// Outcome of a motion of run number `run`.
    fn of(robot_run: RobotRun, run: usize) -> Self {
        let has_begun =
            robot_run.record.samples > 0 || robot_run.ways.as_ref().is_some_and(|ways| ways.approach.samples > 0);
        let cut_short = |robot_run: RobotRun| {
            let how = format!("run {run}: {}", robot_run.status);
            Self::CutShort(Some(robot_run), CutShort::Failed(how))
        };
        match &robot_run.status {
            RobotStatus::Waiting { .. } => {
                Self::Stopped(IterationStatus::Waiting { reason: robot_run.status.to_string() })
            }
            RobotStatus::Failed { .. } => cut_short(robot_run),
            // If a robot did not move, its log contains no information about the controller.
            RobotStatus::Stopped { .. } if !has_begun => cut_short(robot_run),
            RobotStatus::Interrupted { .. } => {
                let how = robot_run.status.to_string();
                Self::CutShort(Some(robot_run), CutShort::Interrupted(how))
            }
            RobotStatus::Done
            | RobotStatus::Simulated { .. }
            | RobotStatus::Stopped { .. }
            | RobotStatus::Oscillated { .. }
            | RobotStatus::LeftEnvelope { .. } => Self::Run(robot_run),
        }
    }
}
