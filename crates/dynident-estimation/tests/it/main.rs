//! Integration tests, linked into one binary.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod common;
mod coverage;
mod cross_validation;
mod errors_in_variables;
mod excitation;
mod factor;
mod fleet;
mod golden;
mod golden_robust;
mod honest;
mod jackknife;
mod joint_gains;
mod known_columns;
mod left_out_blocks;
mod noise_levels;
mod physical_errors;
mod physical_golden;
mod physical_intervals;
mod physical_problems;
mod physical_routes;
mod physical_verdicts;
mod rank;
mod simulated;
mod spline_motion;
mod stored_factor;
mod validation;
mod weighted;
