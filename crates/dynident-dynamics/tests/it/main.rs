//! Integration tests, linked into one binary.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod base_parameters;
mod batches;
mod coupled_joints;
mod golden;
mod golden_base_parameters;
mod invariants;
mod mjcf;
mod pinocchio;
mod right_angles;
mod sdf;
