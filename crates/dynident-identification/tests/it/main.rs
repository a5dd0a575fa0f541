//! Integration tests of the crate.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod changed_bodies;
mod events;
mod pauses;
