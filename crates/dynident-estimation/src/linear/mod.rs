//! **Estimators of `τ = W θ + noise`**: each takes a problem and its settings and returns an
//! [`Estimate`](crate::Estimate), those with findings of their own in a struct beside it.
//!
//! | what the noise is like | function |
//! | --- | --- |
//! | equal in all joints | [`ordinary_least_squares`] |
//! | a level for each joint | [`weighted_least_squares`] |
//! | the same, some columns known | [`weighted_least_squares_with_known`] |
//! | correlated between joints | [`generalized_least_squares`] |
//! | a level that depends on the velocity | [`noise_weighted_least_squares`] |
//! | gross errors | [`robust_least_squares`] |
//! | what a caller says of it | [`estimate_by`] |
//! | in the columns too | [`instrumental_variables`]; [`hausman_test`] and [`fast_motion`] say whether it matters |
//!
//! A function takes a problem, its settings and, where rows are needed again, a source of rows at last: a pass over the
//! log as often as it is called. [`joint_gains`] estimates the torque constants of the drives from the same rows.

mod fast_motion;
mod function;
mod generalized;
mod hausman;
mod instrumental;
mod joint_gains;
mod known_columns;
mod noise_levels;
mod noise_step;
mod ordinary;
mod projection;
mod robust;
mod weighted;

pub use fast_motion::{FastMotion, fast_motion};
pub use function::{EstimatorRows, OwnEstimate, estimate_by};
pub use generalized::{CrossProblem, GeneralizedEstimate, generalized_least_squares};
pub use hausman::{HausmanColumn, HausmanSettings, HausmanTest, HausmanVerdict, hausman_test};
pub use instrumental::{InstrumentReport, InstrumentalEstimate, InstrumentalSettings, instrumental_variables};
pub use joint_gains::{GainEstimate, GainProblem, JointGain, joint_gains};
pub use known_columns::{KnownColumns, weighted_least_squares_with_known};
pub use noise_levels::{NoiseLevelSettings, NoiseWeightedEstimate, noise_weighted_least_squares};
pub use ordinary::{OrdinarySettings, ordinary_least_squares};
pub use robust::{RobustEstimate, RobustSettings, RowBlock, RowVisitor, RowWeight, robust_least_squares};
pub use weighted::{WeightedSettings, WeightedValues, weighted_least_squares, weighted_values};
