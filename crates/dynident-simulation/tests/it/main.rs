//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod closed_loop;
mod controllers;
mod mujoco;
mod mujoco_springs;
mod plant;
