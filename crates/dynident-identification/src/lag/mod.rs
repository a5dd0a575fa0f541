//! Does the torque come late? The lag between motion and torque with its error bar, as an unknown of the fit: measured
//! together with the parameters, chosen (none, one for all joints, or joints of their own), and taken off the rows.

mod choice;
mod fit;
mod measured;
mod pass;
mod rounds;
mod rows;
mod samples;
mod unknowns;

pub use crate::settings::LagCandidates;
pub use choice::{LagChoice, LagKind};
pub use fit::LagFit;
pub use measured::{TorqueLag, delay_findings, pooled_delay};
pub use pass::{lag_fit, lags_of_recordings};
pub use rounds::LagRounds;

pub(crate) use choice::gain_errors;
pub(crate) use fit::LONGEST_DELAY_S;
pub(crate) use pass::lags_after_pass;
pub(crate) use samples::{DELAY_SAMPLES, DelayCheck};
