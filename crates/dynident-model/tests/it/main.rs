//! Integration tests of this crate in one binary.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod audit;
mod broken;
mod common;
mod declared_torque;
mod dh;
mod dh_write;
mod friction_laws;
mod mjcf;
mod mjcf_write;
mod sdf;
mod sdf_write;
mod slips;
mod urdf;
mod urdf_write;
