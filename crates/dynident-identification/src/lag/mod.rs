//! Lag between motion and torque: estimated together with the parameters, selected (no lag, one lag for all joints, or
//! separate lags), and compensated.

mod choice;
mod fit;
mod measured;
mod pass;
mod reversal;
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

pub(crate) use crate::thresholds::LONGEST_DELAY_S;
pub(crate) use choice::gain_errors;
pub(crate) use pass::lags_after_pass;
pub(crate) use samples::{DELAY_SAMPLES, DelayCheck};
