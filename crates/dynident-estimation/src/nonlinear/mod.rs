//! **Estimators that iterate on the model**: the rows themselves depend on what is sought.
//!
//! [`maximum_likelihood`] accounts for errors of known size in every position of a periodic motion,
//! [`simulated_least_squares`] compares a simulated motion with the measured one (or its torque),
//! [`simultaneous_least_squares`] estimates the motion together with the parameters from encoder and torque channels
//! whose noise is coloured; [`simultaneous_bound`] is the Cramér-Rao bound of that problem;
//! [`spline_motion_least_squares`] does the same for any log, the motion a smoothing spline.

mod autoregression;
mod maximum_likelihood;
mod simulated;
mod simultaneous;
mod simultaneous_rows;
mod spline_motion;

pub use maximum_likelihood::{
    InstantRows, InstantVisitor, MaximumLikelihoodEstimate, MaximumLikelihoodSettings, maximum_likelihood,
};
pub use simulated::{
    SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows, SimulatedSettings,
    simulated_least_squares,
};
pub use simultaneous::{
    ChannelNoise, SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings,
    simultaneous_bound, simultaneous_least_squares,
};
pub use simultaneous_rows::ChannelRows;
pub use spline_motion::{
    SplineJointFit, SplineLogFit, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    TorqueModel, TorqueSlopes, spline_motion_least_squares,
};
