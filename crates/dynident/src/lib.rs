//! **The whole job**: a study file in, a dynamic model with error bars and its proof out.
//!
//! [`identify()`] fits a [`Study`]'s model to its logs and tests it on the held-out ones; [`validate()`] tests a finished model; [`inspect()`] audits a robot
//! description; [`evaluate()`] computes dynamics for a table of states; [`design_study()`] finds the motion to record, [`check_trajectory()`] and [`check_log()`] judge one that is there. The rooms below are re-exported: [`model`],
//! [`dynamics`], [`recording`], [`estimation`], [`excitation`], [`simulation`], [`identification`], [`iteration`].

#![forbid(unsafe_code)]

pub mod benchmark;
#[cfg(doctest)]
pub mod book;
mod cpu_time;
mod error;
mod jobs;
mod output;
mod pages;
pub mod result;
pub mod study;

pub use dynident_dynamics as dynamics;
pub use dynident_estimation as estimation;
pub use dynident_excitation as excitation;
pub use dynident_identification as identification;
pub use dynident_iteration as iteration;
pub use dynident_model as model;
pub use dynident_recording as recording;
pub use dynident_simulation as simulation;

pub use dynident_identification::{Progress, Role, Silent};
pub use error::Error;
pub use jobs::design::{DesignOutcome, check_log, check_trajectory, design_study};
pub use jobs::evaluate::{Quantity, evaluate};
pub use jobs::identify::{IdentificationOutcome, identify, identify_with_instruments};
pub use jobs::inspect::inspect;
pub use jobs::iterate::{IterationWatch, iterate_study};
pub use jobs::options::RunOptions;
pub use jobs::simulate::{Simulation, simulate_study};
pub use jobs::validate::validate;
pub use output::{check_writable, write_whole};
pub use result::{DesignFile, Inspection, IterationsFile, ResultFile, SimulationFile, ValidationFile};
pub use study::{Folders, Study, StudyRobot};
