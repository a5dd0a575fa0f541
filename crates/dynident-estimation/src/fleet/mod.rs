//! **Several robots of one type.** Compares one estimate per robot, or per week of one robot.
//!
//! An estimate is a [`Member`]: values and standard deviations. [`spread`] finds parameters that differ between robots
//! by more than their error bars and robots that differ from the others; [`drift`] follows one robot over time.

mod drift;
mod member;
mod spread;

pub use drift::{Drift, ParameterDrift, drift};
pub use member::Member;
pub use spread::{MemberDeviation, ParameterSpread, Spread, spread};
