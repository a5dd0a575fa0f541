//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod page;
mod surface;
