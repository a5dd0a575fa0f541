use crate::estimation::estimate::RunEstimate;
use crate::estimation::forecast::MotionForecast;
use crate::estimation::run_motion::RunMotion;
use crate::robot::StopSignal;
use crate::setup::error::IterationError;
use crate::setup::leg::Leg;
use dynident_dynamics::ParametricModel;

/// Data that a planner receives before a run.
#[derive(Clone, Copy, Debug)]
pub struct BeforeRun<'a> {
    /// Number of the run to be planned, from 2.
    pub run: usize,
    /// The robot with the selected friction.
    pub robot: &'a ParametricModel,
    /// Estimate from all good runs, or from the last good run if runs are not fitted together.
    pub known: &'a RunEstimate,
    /// The runs of this estimate, in order; not empty.
    pub good: &'a [GoodRun<'a>],
    /// Torque limit of each joint, Nm (N), or infinity.
    pub torque_limits: Option<&'a [f64]>,
    /// Signal that ends a search with its best result.
    pub stop: Option<&'a StopSignal>,
}

/// A good run as input of planners.
#[derive(Clone, Copy, Debug)]
pub struct GoodRun<'a> {
    /// Trajectories of the run.
    pub legs: &'a [Leg],
    /// Estimate from this run alone.
    pub estimate: &'a RunEstimate,
}

/// The planned motion of a run, with its forecast.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedMotion {
    /// Trajectories; `None` repeats those of the previous good run.
    pub motion: Option<RunMotion>,
    /// The forecast.
    pub forecast: MotionForecast,
}

/// Plans the next motion, after the first good run. Without a planner every run repeats the motion of the task.
pub trait MotionPlanner: core::fmt::Debug + Send + Sync {
    /// Plans the motion of a run that follows a good run. It is called once per run, and the plan is stored with the
    /// iteration, so it need not be reproducible.
    ///
    /// # Errors
    /// A task for which motions cannot be planned. If no better motion is found, the plan repeats the last one.
    fn plan(&self, before: &BeforeRun<'_>) -> Result<PlannedMotion, IterationError>;
}
