//! Conversion of a log to positions q, velocities dq, accelerations ddq and torque on a uniform clock, block by block.
//!
//! [`MotionStream`] combines reader, clock, differentiator and checks, and returns [`MotionBlock`]s. [`MotionSettings`]
//! contains its settings.

mod block;
mod marks;
mod opening;
mod stream;
mod torque_lag;

pub use block::{ImportLimits, MotionBlock, MotionSettings, unsettled_samples};
pub use stream::MotionStream;
