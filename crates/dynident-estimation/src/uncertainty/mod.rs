//! **How far may it be off?** The [`Estimate`] that every linear estimator returns, and where its error bars come from.
//!
//! Residuals of robot torque are correlated in time, so the textbook covariance is too small. A [`CovarianceMethod`]
//! names another: the default leaves out one time segment after the other (delete-one jackknife). Degrees of
//! freedom by Satterthwaite turn a standard deviation into a half-width of 95 % by [`student_half_width`].

mod bootstrap;
mod covariance;
mod distributions;
mod estimate;
mod newey_west;
mod scores;

pub use covariance::{CovarianceMethod, correlation};
pub use distributions::{HALF_WIDTH_95, student_half_width};
pub(crate) use distributions::{chi_squared_tail, f_tail};
pub use estimate::{Estimate, EstimateStatus};
pub(crate) use estimate::{PointEstimate, covariance_of_all, joint_degrees_of_freedom};
