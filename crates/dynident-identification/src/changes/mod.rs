//! Statistical test of which parts of a robot differ from its description, or between two results.
//!
//! [`parts`] lists the parts with their effect on the base parameters. [`Differences`] compares explanations of the
//! difference from the robot description or between two estimates: no change, a change of one or two parts, or small or
//! large differences of every body. For a robot description, it also computes the uncertainty of the bodies over all
//! explanations.

mod average;
mod differences;
mod log_loads;
mod parts;
mod positive;
mod spread;
mod written;

pub use average::BodyUncertainty;
pub use differences::Differences;
pub use log_loads::LogLoad;
pub(crate) use log_loads::log_loads;
pub use parts::{Part, Parts, parts};
pub use spread::{SPREADS, Spread};
pub use written::RestoredBody;
pub(crate) use written::{knowledge_of, restored_errors};
