//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod differentiators;
mod folder_logs;
mod function_robots;
mod held_out;
mod home;
mod identification;
mod iteration;
mod late_controllers;
mod near_rest;
mod observer;
mod oscillations;
mod policy;
mod pooling;
mod redesign;
mod rehearsals;
mod robots;
mod run_offsets;
mod scara;
mod simulated_arm;
mod stops;
mod torque_check;
mod verdict;
mod warm_up;
