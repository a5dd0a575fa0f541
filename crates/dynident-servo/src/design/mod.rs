//! Design of commands that determine the unknowns of a fit as accurately as possible.
//!
//! The criterion is `log det (Σ g gᵀ / (σ² c) + priors)` (D-optimality) of the simulated closed loop, summed over
//! samples and joints. Here `g` is the exact derivative of a position by the unknowns, `σ` the standard deviation of
//! its error, and `c` the number of samples with correlated errors. The commands are a sequence of segments from rest
//! to rest, so that the information of the segments adds up. First, the best of many random segments is selected for
//! each place in the sequence. Then exchanges replace segments by better ones between the same end postures (Fedorov
//! 1972; Mitchell 1974).

mod information;
mod search;
mod segment;
mod settings;

pub use search::{DesignedCommands, Forecast, MotionCheck, design_commands};
pub use segment::CommandRange;
pub use settings::ServoDesignSettings;
