//! Statistical test of which parts of a robot differ from its description, or between two results.
//!
//! [`parts`] lists the parts with their effect on the base parameters. [`DescriptionDifferences`] compares explanations
//! of the difference from the robot description: no change, a change of single bodies or pairs of bodies, or small or
//! large differences of every body. It also computes the uncertainty of the bodies over all explanations.

mod average;
mod description;
mod log_loads;
mod parts;
mod positive;
mod written;

pub use average::BodyUncertainty;
pub use description::{DescriptionDifferences, SPREADS, Spread};
pub use log_loads::LogLoad;
pub(crate) use log_loads::log_loads;
pub use parts::{Part, Parts, parts};
pub use written::RestoredBody;
pub(crate) use written::{knowledge_of, restored_errors};
