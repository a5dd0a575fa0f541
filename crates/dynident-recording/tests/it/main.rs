//! Integration tests of this crate in one binary.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod broken_files;
mod cleaning;
mod memory;
mod real_logs;
mod scipy;
mod streaming;
