//! Who says what the next motion is.

use crate::error::IterationError;
use crate::estimate::RunEstimate;
use crate::forecast::MotionForecast;
use crate::leg::Leg;
use crate::robot::StopSignal;
use crate::run_motion::RunMotion;
use dynident_dynamics::ParametricModel;

/// What is known before a run.
#[derive(Clone, Copy, Debug)]
pub struct BeforeRun<'a> {
    /// Number of the run that is to be planned, from 2.
    pub run: usize,
    /// The robot, with the friction in force.
    pub robot: &'a ParametricModel,
    /// What all good runs say together, or the last alone where they are not pooled.
    pub known: &'a RunEstimate,
    /// The runs that this was made of, in order; not empty.
    pub good: &'a [GoodRun<'a>],
    /// The largest torque of each joint, Nm (N); infinite where there is none.
    pub torque_limits: Option<&'a [f64]>,
    /// Where a stop may be asked for: a search then ends with what it has.
    pub stop: Option<&'a StopSignal>,
}

/// A good run as planners see it.
#[derive(Clone, Copy, Debug)]
pub struct GoodRun<'a> {
    /// Its legs.
    pub legs: &'a [Leg],
    /// What it says by itself.
    pub estimate: &'a RunEstimate,
}

/// A motion for a run that has not been made, with what it is expected to bring.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedMotion {
    /// The trajectories, leg by leg; none for those of the good run before, once more.
    pub motion: Option<RunMotion>,
    /// What it is expected to bring.
    pub forecast: MotionForecast,
}

/// Who says what the next motion is, from the second good run on. Without one every run repeats the motion of the task.
pub trait MotionPlanner: core::fmt::Debug + Send + Sync {
    /// The motion of a run that follows a good one. It is asked once for each run: what it says is kept with the
    /// iteration, so that it need not say the same again.
    ///
    /// # Errors
    /// A task that motions cannot be planned for. That no better motion was found is a plan.
    fn plan(&self, before: &BeforeRun<'_>) -> Result<PlannedMotion, IterationError>;
}
