//! **Nonlinear estimators**: the rows depend on the unknowns.
//!
//! [`simulated_least_squares`] fits the simulated to the measured motion (or torque). [`simultaneous_least_squares`]
//! estimates motion and parameters together from positions and torques with noise that is correlated in time;
//! [`simultaneous_bound`] is its Cramér-Rao bound. [`spline_motion_least_squares`] also estimates motion and
//! parameters together, for any log: the motion is a smoothing spline.

mod autoregression;
mod simulated;
mod simultaneous;
mod simultaneous_problem;
mod simultaneous_rows;
mod spline_motion;

pub use simulated::{
    SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows, SimulatedSettings,
    simulated_least_squares,
};
pub use simultaneous::{simultaneous_bound, simultaneous_least_squares};
pub use simultaneous_problem::{
    ChannelNoise, SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings,
};
pub use simultaneous_rows::ChannelRows;
pub use spline_motion::{
    SplineJointFit, SplineLogFit, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    TorqueModel, TorqueSlopes, spline_motion_least_squares,
};
