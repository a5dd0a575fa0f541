//! Converts a log to q, dq, ddq and torque on a uniform clock, block by block.
//!
//! [`MotionStream`] combines reader, clock, differentiator and checks, and returns [`MotionBlock`]s; [`MotionSettings`]
//! configures it.

mod block;
mod marks;
mod opening;
mod stream;
mod torque_lag;

pub use block::{ImportLimits, MotionBlock, MotionSettings, unsettled_samples};
pub use stream::MotionStream;
