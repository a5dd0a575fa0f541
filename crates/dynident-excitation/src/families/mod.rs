//! Trajectory families, one file each.
//!
//! | family | parameters per joint | at rest at the ends |
//! | --- | --- | --- |
//! | [`SplicedLogistic`]: logistic functions back and forth (Eqs. 12 to 14 of *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*) | 2 or 3 | nearly (e^-10) |
//! | [`LogisticStrokes`]: overlapping or consecutive strokes | 3 K or 3 K - 1 | exactly |
//! | [`Fourier`]: H harmonics | 2 H + 1, at rest 2 H - 1 | optional |
//! | [`Quintic`]: piecewise through M waypoints | M - 1, with free velocities and accelerations 3 M - 5 | exactly |
//! | [`BSpline`]: degree 5, n control points | n - 5 | exactly |
//! | [`Multisine`]: Schroeder phases | 2 | with ramps |
//! | [`FrictionLadder`]: constant-velocity sweeps | 2 | exactly |
//! | [`StaticPostures`]: K held postures | K | exactly |
//! | [`StepWiseLogistic`]: spliced logistic functions, one joint after another | 2 | nearly (e^-10) |
//! | [`FamilySequence`]: a sequence of families | sum | as its members |
//! | [`WithStartPosture`]: a family shifted to a start posture | as the family | as the family |
//! | [`SampledMotion`]: a known motion | 0 | as the motion |
//! | [`FunctionFamily`]: a user's function | as the function | as the function |

mod b_spline;
#[cfg(test)]
mod check;
mod error;
mod fourier;
mod friction_ladder;
mod function;
mod given;
mod joined;
mod linear;
mod logistic_lanes;
mod logistic_stroke;
mod logistic_strokes;
mod multisine;
mod polynomials;
mod quintic;
mod random_start;
mod sampled_basis;
mod spliced_logistic;
mod starting_at;
mod static_postures;
mod step_wise;

pub use b_spline::{BSpline, BSplineSettings};
pub use error::FamilyError;
pub use fourier::{Fourier, FourierSettings};
pub use friction_ladder::{FrictionLadder, FrictionLadderSettings, LadderPace};
pub use function::{FunctionFamily, FunctionFamilySettings, MotionFunction};
pub use given::SampledMotion;
pub use joined::{FamilySequence, JoinedSettings};
pub use linear::{Basis, LinearFamily};
pub use logistic_stroke::LogisticStroke;
pub use logistic_strokes::{LogisticStrokes, LogisticStrokesSettings, StrokeOrder};
pub use multisine::{Multisine, MultisineSettings};
pub use quintic::{Quintic, QuinticSettings};
pub use spliced_logistic::{SplicedLogistic, SplicedLogisticSettings};
pub use starting_at::WithStartPosture;
pub use static_postures::{StaticPostures, StaticPosturesSettings};
pub use step_wise::{Step, StepWiseLogistic};
