//! Commands that make the unknowns of a fit as certain as possible.
//!
//! The criterion is `log det (Σ g gᵀ / (σ² c) + priors)` (D-optimality) of the simulated closed loop, with the exact
//! derivatives `g` of the positions that the fit uses. The commands are a sequence of segments from rest to rest, so
//! that their information adds. A greedy choice among random segments takes the best for each place; exchanges then
//! replace segments by better ones between the same ends (Fedorov 1972; Mitchell 1974).

mod information;
mod search;
mod segment;
mod settings;

pub use search::{DesignedCommands, Forecast, MotionCheck, design_commands};
pub use segment::CommandRange;
pub use settings::ServoDesignSettings;
