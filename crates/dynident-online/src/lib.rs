//! Online monitoring of a robot, one sample at a time and without allocation: recursive estimates of the parameters,
//! detection of contacts, payloads and drift.
//!
//! | task | take |
//! | --- | --- |
//! | all of it, by an identified model | [`Watch`] |
//! | velocities and accelerations of positions that come one by one | [`DelayedDerivatives`] |
//! | the estimate that a batch would give, after every sample | [`OnlineEstimator`] |
//! | a collision, a payload, a hand on the arm | [`ContactMonitor`] |
//! | whether the model is still true of the robot | [`DriftMonitor`] |
//! | bodies and friction that can be real, now | [`OnlineEstimator::consistent`] |
//!
//! Everything is for one robot, a [`ParametricModel`](dynident_dynamics::ParametricModel), and for samples at one rate.

#![forbid(unsafe_code)]

mod contact;
mod derivatives;
mod drift;
mod error;
mod estimator;
mod watch;

pub use contact::{Contact, ContactMonitor, ContactSettings, Look, Residuals};
pub use derivatives::{DelayedDerivatives, DelayedSample};
pub use drift::{DriftAlarm, DriftMonitor, DriftSettings};
pub use error::OnlineError;
pub use estimator::{OnlineEstimator, OnlineSettings, StartingPoint};
pub use watch::{Watch, WatchSettings};
