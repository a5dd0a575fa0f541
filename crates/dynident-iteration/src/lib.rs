//! **The iteration**: run, identify, load the better model, run again.
//!
//! One run's identification ([`identify_run`]): record → differentiator → regressor rows → estimate with covariance, all joints at once or step by step from tip to base as in the paper. The policy
//! ([`Iteration::next`]) is a pure function of the records so far: which controller and model the next run has, whether a run got worse, when all has settled. [`iterate()`] drives robots with it;
//! an [`IterationStore`] keeps every run on disk, so that a killed iteration resumes to the same result.

mod drive;
mod error;
mod estimate;
mod leg;
mod motion;
mod policy;
mod record;
pub mod robot;
mod settings;
mod status;
mod step_by_step;
mod store;

pub use drive::{Iteration, IterationOutcome, iterate};
pub use error::IterationError;
pub use estimate::{RunEstimate, identify_run};
pub use leg::{IterationTask, Leg};
pub use motion::measured_motion;
pub use policy::{Next, RunPlan};
pub use record::{ModelParameters, RunRecord, UsedController};
pub use robot::{Robot, RobotFault, RobotRun, RobotStatus, RunRequest, SimulatedRobot};
pub use settings::{IterationSettings, RunIdentificationSettings, Scheme, SettledSettings, StartWith};
pub use status::IterationStatus;
pub use store::IterationStore;
