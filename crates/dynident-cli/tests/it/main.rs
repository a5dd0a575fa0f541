//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

#[cfg(unix)]
mod answers;
mod broken_inputs;
mod common;
mod contract;
mod design;
mod design_check;
mod design_paper;
mod docs;
mod edited_result;
mod evaluation;
mod export;
mod factors;
mod faults;
mod files;
mod first_steps;
mod hostile_names;
mod iterate;
mod iterate_again;
mod live;
mod packing;
mod plot;
mod programs;
mod reproduce;
mod robots_outside;
mod schemas;
mod servo;
mod sources;
mod verdict;
mod view;
