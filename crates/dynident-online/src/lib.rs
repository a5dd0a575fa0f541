//! **Does the model still hold, now?** One sample at a time, without allocation: the parameters as the newest samples
//! have them, what touches the robot, what it carries, and whether the model has drifted.
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
