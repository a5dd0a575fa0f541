//! The online crate against the batch, and against simulated contact.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod consistent;
mod contact;
mod derivatives;
mod drift;
mod estimator;
