//! Tests of the online crate with the batch estimate and simulated contact as references.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod consistent;
mod contact;
mod derivatives;
mod drift;
mod estimator;
