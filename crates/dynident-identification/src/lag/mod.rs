//! Does the torque come late? The lag between motion and torque with its error bar, as an unknown of the fit: measured
//! together with the parameters, chosen (none, one for all joints, or joints of their own), and taken off the rows.

mod choice;
mod fit;
mod measured;
mod rows;
mod samples;

pub use choice::{LagChoice, LagKind};
pub use measured::{TorqueLag, delay_findings, pooled_delay};

pub(crate) use choice::{choose_lag, with_lag_error};
pub(crate) use fit::{LagFit, fit_lags, lags_of_log};
pub(crate) use samples::{DELAY_SAMPLES, DelayCheck};
