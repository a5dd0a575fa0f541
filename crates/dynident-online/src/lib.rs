//! Online monitoring of a robot, one sample at a time and without allocation: recursive estimates of the parameters,
//! detection of contacts, payloads and drift.
//!
//! | task | use |
//! | --- | --- |
//! | complete monitoring with an identified model | [`Watch`] |
//! | velocities and accelerations from a stream of positions | [`DelayedDerivatives`] |
//! | recursive estimate, equal to the estimate from all samples at once | [`OnlineEstimator`] |
//! | detection of collisions, payloads, and a hand on the arm | [`ContactMonitor`] |
//! | detection of drift | [`DriftMonitor`] |
//! | current physically consistent parameters | [`OnlineEstimator::consistent`] |
//!
//! Each object is for one robot, a [`ParametricModel`](dynident_dynamics::ParametricModel), and one sampling rate.

#![forbid(unsafe_code)]

mod contact;
mod derivatives;
mod drift;
mod error;
mod estimator;
mod watch;

pub use contact::{Contact, ContactMonitor, ContactSettings, ContactState, Residuals, TimeScale};
pub use derivatives::{DelayedDerivatives, DelayedSample, DerivativesState};
pub use drift::{DriftAlarm, DriftMonitor, DriftSettings};
pub use error::OnlineError;
pub use estimator::{EstimatorState, OnlineEstimator, OnlineSettings, StartingPoint};
pub use watch::{Watch, WatchSettings, WatchState};
