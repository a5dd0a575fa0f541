//! From a log to q, dq, ddq and torque on a uniform clock, block by block.
//!
//! [`MotionStream`] pulls rows through everything below: reader, clock, differentiator, checks. [`MotionBlock`] is what
//! it gives, [`MotionSettings`] is how it is set up.

mod block;
mod marks;
mod opening;
mod stream;
mod torque_lag;

pub use block::{MotionBlock, MotionSettings};
pub use stream::MotionStream;
