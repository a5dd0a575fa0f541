//! Integration tests of this crate in one binary.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

mod common;
mod compiled;
mod descriptions;
mod isaac_lab;
mod memory;
mod parameters;
mod refused;
mod simulator;
