//! **Run it again, better.** Run, identify, load the better model, run again; robots outside, and a store of every run.
//!
//! | task | take |
//! | --- | --- |
//! | the loop | [`iterate()`] of an [`IterationTask`] with [`IterationSettings`] |
//! | what is run | [`Leg`]: a trajectory and which of its rows count |
//! | a simulated robot | [`SimulatedRobot`] |
//! | a program that speaks the line protocol, or a person with a folder | [`robot`] |
//! | a robot of one's own | a type with [`Robot`] |
//! | one run's identification | [`identify_run`]: all joints at once, or step by step from tip to base as in the paper |
//! | what the next run is | [`Iteration::next`], a pure function of the records so far: which controller and model it has, whether a run got worse, when all has settled |
//! | kept on disk, and resumed to the same result | [`IterationStore`] |
//!
//! The crate `dynident` wraps it as `dynident iterate`, with trajectories, robots and controllers from a study file.

#![forbid(unsafe_code)]

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
