//! **Many robots of one kind.** One estimate for each robot, or for each week of one robot: which parameters differ by
//! more than their error bars, which robot is not like the others, which parameter wanders.
//!
//! An estimate is a [`Member`]: values and covariance. [`spread`] compares robots, [`drift`] follows one over time.

mod drift;
mod member;
mod spread;

pub use drift::{Drift, ParameterDrift, drift};
pub use member::Member;
pub use spread::{MemberDeviation, ParameterSpread, Spread, spread};
