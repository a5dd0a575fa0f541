//! The integration tests of this crate, linked once.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod between_logs;
mod book;
mod check_mistakes;
mod common;
mod consistent_intervals;
mod consistent_parameters;
mod design_contact;
mod design_messages;
mod design_tasks;
mod differentiators;
mod drive_gains;
mod estimators;
mod excitation;
mod exogeneity;
mod friction_choice;
mod instruments;
mod iteration_legs;
mod iteration_report;
mod masses;
mod modules;
mod mutated_studies;
mod payload;
mod real_logs;
mod real_mistakes;
mod report;
mod result_files;
mod reversed_torque;
mod same_result;
mod scales;
mod simulated_loop;
mod spoilt_logs;
mod synthetic_truth;
mod temperature;
mod torque_lag;
mod ur10_example;
