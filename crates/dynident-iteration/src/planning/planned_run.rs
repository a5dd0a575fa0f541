use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_motion::legs_along;
use crate::planning::planner::{BeforeRun, GoodRun, MotionPlanner, PlannedMotion};
use crate::policy::record::RunRecord;
use crate::robot::StopSignal;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};

/// Plans the run after `records`, the last of which is good; `task` includes the selected friction. If runs are not
/// fitted together, or could not be, only the last run is used.
pub(crate) fn planned_motion(
    planner: &dyn MotionPlanner,
    task: &IterationTask,
    records: &[RunRecord],
    pool: bool,
    stop: Option<&StopSignal>,
) -> Result<PlannedMotion, IterationError> {
    let run = records.len() + 1;
    let good = records.iter().filter(|record| record.accepted && record.estimate.is_some());
    let mut good: Vec<&RunRecord> = good.collect();
    let last = good.last().copied();
    if last.is_none_or(|last| last.pooled.is_none()) || !pool {
        good = last.into_iter().collect();
    }
    let legs: Vec<Vec<Leg>> = good
        .iter()
        .map(|record| Ok(legs_along(task, record.motion.as_ref())?.into_owned()))
        .collect::<Result<_, IterationError>>()?;
    let estimates: Vec<&RunEstimate> = good.iter().filter_map(|record| record.estimate.as_ref()).collect();
    let good: Vec<GoodRun<'_>> =
        legs.iter().zip(&estimates).map(|(legs, estimate)| GoodRun { legs, estimate }).collect();
    let Some(known) = last.and_then(RunRecord::knowledge) else {
        let problem = "no good run is available to plan the next motion".to_owned();
        return Err(IterationError::Planning { run, problem });
    };
    let torque_limits = task.torque_limits.as_deref();
    planner.plan(&BeforeRun { run, robot: &task.robot, known, good: &good, torque_limits, stop })
}
