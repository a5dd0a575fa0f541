//! What residuals look like: white? normal? larger at reversals? Accumulators, fed sample after sample; memory does not grow.

mod normality;
mod regimes;
mod whiteness;

pub use normality::{Normality, NormalityReport};
pub use regimes::{RegimeFigures, Regimes, RegimesReport};
pub use whiteness::{Whiteness, WhitenessReport};
