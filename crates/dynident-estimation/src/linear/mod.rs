//! **Estimators of `τ = W θ + noise`** with torque τ, regressor W and parameters θ. Each takes a problem and settings
//! and returns an [`Estimate`](crate::Estimate), alone or in a struct with further results.
//!
//! | noise | function |
//! | --- | --- |
//! | equal in all joints | [`ordinary_least_squares`] |
//! | one level per joint | [`weighted_least_squares`] |
//! | one level per joint, some columns known | [`weighted_least_squares_with_known`] |
//! | correlated between joints | [`generalized_least_squares`] |
//! | a level that depends on the velocity | [`noise_weighted_least_squares`] |
//! | gross errors | [`robust_least_squares`] |
//! | custom | [`estimate_by`] |
//! | also in the columns of W | [`instrumental_variables`]; tests: [`hausman_test`] and [`fast_motion`] |
//!
//! Estimators that weight single rows also take a function that passes over the rows of the log. [`joint_gains`]
//! estimates the torque constants of the drives from the same rows.

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
pub use function::{CustomEstimate, EstimatorRows, estimate_by};
pub use generalized::{CrossProblem, GeneralizedEstimate, generalized_least_squares};
pub use hausman::{HausmanColumn, HausmanSettings, HausmanTest, HausmanVerdict, hausman_test};
pub use instrumental::{InstrumentReport, InstrumentalEstimate, InstrumentalSettings, instrumental_variables};
pub use joint_gains::{GainEstimate, GainProblem, JointGain, joint_gains};
pub use known_columns::{KnownColumns, weighted_least_squares_with_known};
pub use noise_levels::{NoiseLevelSettings, NoiseWeightedEstimate, noise_weighted_least_squares};
pub use ordinary::{OrdinarySettings, ordinary_least_squares};
pub use robust::{RobustEstimate, RobustSettings, RowBlock, RowVisitor, RowWeight, robust_least_squares};
pub use weighted::{WeightedSettings, WeightedValues, weighted_least_squares, weighted_values};
