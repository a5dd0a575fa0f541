//! Tests of the crate, one program.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

mod common;
mod compiled;
mod descriptions;
mod parameters;
mod refused;
mod simulator;
