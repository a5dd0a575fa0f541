//! **Uncertainty**: the [`Estimate`] that every linear estimator returns, and its error bars.
//!
//! Residuals of robot torque are correlated in time, so the textbook covariance is too small. A [`CovarianceMethod`]
//! selects another covariance; the default is the delete-one jackknife over time segments. [`student_half_width`]
//! with Satterthwaite's degrees of freedom converts a standard deviation to the half-width of the 95 % interval.

mod bootstrap;
mod covariance;
mod distributions;
mod estimate;
mod newey_west;
mod scores;

pub use covariance::{CovarianceMethod, correlation};
pub use distributions::chi_squared_tail;
pub(crate) use distributions::f_tail;
pub use distributions::{HALF_WIDTH_95, normal_below, student_half_width};
pub use estimate::{Estimate, EstimateStatus};
pub(crate) use estimate::{PointEstimate, covariance_of_all, joint_degrees_of_freedom};
