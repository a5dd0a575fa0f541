//! **What do the measurements say?** From rows `[W | τ]` of numbers to parameters with error bars.
//!
//! This crate never knows where samples came from: it sees columns, joints and numbers. The way through it:
//!
//! 1. Rows of one joint in one log go into a [`SegmentedFactor`]: at most K triangular factors of consecutive time segments. The
//!    rows are then forgotten; memory does not grow with the log.
//! 2. The factors of all joints and logs make a [`LinearProblem`] over named columns.
//! 3. [`ordinary_least_squares`] or [`weighted_least_squares`] gives an [`Estimate`]: values, a covariance that accounts for
//!    residuals correlated in time, the noise of every joint, and what was decided about columns that the data do not excite.
//!    [`generalized_least_squares`] lets errors of joints be correlated, [`robust_least_squares`] sets gross errors aside, [`total_least_squares`] and
//!    [`instrumental_variables`] account for errors in the columns, [`simultaneous_least_squares`] estimates the motion as well, and [`hausman_test`] says whether those matter.
//! 4. [`Validation`] compares predicted with measured torque, on data that were not used for the fit.

#![forbid(unsafe_code)]

mod autoregression;
mod bootstrap;
mod covariance;
mod cross_validation;
mod diagnostics;
mod distributions;
mod error;
mod essential;
mod estimate;
mod factor;
mod generalized;
mod hausman;
mod instrumental;
mod instrumented;
mod joint_gains;
mod known_columns;
mod maximum_likelihood;
mod newey_west;
mod noise_levels;
mod nonnegative;
mod ordinary;
pub mod physical;
mod problem;
mod projection;
mod rank;
mod reflect;
mod robust;
mod segments;
mod simulated;
mod simultaneous;
mod simultaneous_rows;
mod total;
mod validation;
mod weighted;

pub use covariance::{CovarianceMethod, correlation};
pub use cross_validation::{CrossValidation, FoldErrors, JointFolds};
pub use diagnostics::{Normality, NormalityReport, RegimeFigures, Regimes, RegimesReport, Whiteness, WhitenessReport};
pub use distributions::{chi_squared_tail, f_tail, student_half_width};
pub use error::EstimationError;
pub use essential::{
    CorrelatedPair, DroppedParameter, EssentialEnd, EssentialReport, EssentialSettings, essential,
    strongest_correlations,
};
pub use estimate::{Estimate, EstimateStatus};
pub use factor::{BLOCK_ROWS, FactorWorkspace, TriangularFactor};
pub use generalized::{CrossProblem, GeneralizedEstimate, generalized_least_squares};
pub use hausman::{HausmanColumn, HausmanSettings, HausmanTest, HausmanVerdict, hausman_test};
pub use instrumental::{InstrumentReport, InstrumentalEstimate, InstrumentalSettings, instrumental_variables};
pub use instrumented::InstrumentedProblem;
pub use joint_gains::{GainEstimate, GainProblem, JointGain, joint_gains};
pub use known_columns::{KnownColumns, weighted_least_squares_with_known};
pub use maximum_likelihood::{
    InstantRows, InstantVisitor, MaximumLikelihoodEstimate, MaximumLikelihoodSettings, maximum_likelihood,
};
pub use noise_levels::{NoiseLevelSettings, NoiseWeightedEstimate, noise_weighted_least_squares};
pub use ordinary::{OrdinarySettings, ordinary_least_squares};
pub use problem::{JointRows, LinearProblem, Prior};
pub use rank::{FixedColumn, RankReport, RankSettings};
pub use robust::{RobustEstimate, RobustSettings, RowBlock, RowVisitor, RowWeight, robust_least_squares};
pub use segments::{SegmentScore, SegmentSettings, SegmentedFactor};
pub use simulated::{
    SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows, SimulatedSettings,
    simulated_least_squares,
};
pub use simultaneous::{
    ChannelNoise, SimultaneousEstimate, SimultaneousModel, SimultaneousSettings, simultaneous_bound,
    simultaneous_least_squares,
};
pub use simultaneous_rows::ChannelRows;
pub use total::{TotalEstimate, TotalSettings, total_least_squares};
pub use validation::{JointValidation, Validation, ValidationReport};
pub use weighted::{WeightedSettings, weighted_least_squares};
