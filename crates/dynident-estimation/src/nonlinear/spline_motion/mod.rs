//! Motion and parameters of any log from positions and torques, with a smoothing spline as motion; the likelihood
//! selects the smoothness.
//!
//! | file | content |
//! | --- | --- |
//! | `problem.rs` | problem, settings, model trait and results |
//! | `fit.rs` | [`spline_motion_least_squares`]: steps and noise levels |
//! | `smoothing.rs` | motion from positions alone |
//! | `rows.rs`, `system.rs` | whitened torque rows; normal equations with the motion eliminated; effective unknowns |
//! | `covariance.rs` | covariance of the parameters |
//! | `bspline.rs`, `banded_arrow.rs` | basis functions of the motion; band matrix with an arrow |

mod banded_arrow;
mod bspline;
mod covariance;
mod fit;
mod noise;
mod problem;
mod rows;
mod smoothing;
mod system;

pub use fit::spline_motion_least_squares;
pub use problem::{
    SplineJointFit, SplineLogFit, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    TorqueModel, TorqueSlopes,
};
