//! Motion and parameters of any log at once: positions and torques of every joint, the motion a smoothing spline whose
//! smoothness the likelihood chooses.
//!
//! | file | what |
//! | --- | --- |
//! | `problem.rs` | what is sought and measured, what the model is asked, what comes out |
//! | `fit.rs` | [`spline_motion_least_squares`]: the steps and the noise levels |
//! | `smoothing.rs` | the motion from positions alone |
//! | `rows.rs`, `system.rs` | whitened torque rows; normal equations, the motion eliminated; who pays for which unknown |
//! | `covariance.rs` | the parameters' covariance |
//! | `bspline.rs`, `banded_arrow.rs` | functions of the motion; a band with an arrow |

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
