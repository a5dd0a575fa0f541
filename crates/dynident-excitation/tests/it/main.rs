//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod common;
mod design;
mod feasibility;
mod information;
mod limit_messages;
mod limits;
mod meshes;
mod single_change;
