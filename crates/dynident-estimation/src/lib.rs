//! **What do the measurements say?** From rows `[W | τ]` of numbers to parameters with error bars.
//!
//! This crate never knows where samples came from: it sees columns, joints and numbers.

#![forbid(unsafe_code)]

mod error;
mod factor;
mod reflect;
mod segments;

pub use error::EstimationError;
pub use factor::{BLOCK_ROWS, FactorWorkspace, TriangularFactor};
pub use segments::{SegmentScore, SegmentSettings, SegmentedFactor};
