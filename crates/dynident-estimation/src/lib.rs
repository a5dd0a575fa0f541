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

pub mod consistent;
pub mod diagnostics;
mod error;
pub mod factor;
pub mod linear;
pub mod nonlinear;
pub mod uncertainty;

pub use diagnostics::{
    CorrelatedPair, CrossValidation, EssentialEnd, EssentialReport, EssentialSettings, FoldErrors, JointFolds,
    Normality, NormalityReport, Regimes, RegimesReport, Validation, ValidationReport, Whiteness, WhitenessReport,
    essential, strongest_correlations,
};
pub use error::EstimationError;
pub use factor::{
    InstrumentedProblem, JointRows, LinearProblem, Prior, RankSettings, SegmentSettings, SegmentedFactor,
    TriangularFactor,
};
pub use linear::{
    CrossProblem, GainProblem, GeneralizedEstimate, HausmanSettings, HausmanTest, HausmanVerdict, InstrumentReport,
    InstrumentalEstimate, InstrumentalSettings, JointGain, KnownColumns, NoiseLevelSettings, NoiseWeightedEstimate,
    OrdinarySettings, RobustEstimate, RobustSettings, RowBlock, RowVisitor, RowWeight, TotalEstimate, TotalSettings,
    WeightedSettings, generalized_least_squares, hausman_test, instrumental_variables, joint_gains,
    noise_weighted_least_squares, ordinary_least_squares, robust_least_squares, total_least_squares,
    weighted_least_squares, weighted_least_squares_with_known,
};
pub use nonlinear::{
    ChannelNoise, ChannelRows, InstantRows, InstantVisitor, MaximumLikelihoodEstimate, MaximumLikelihoodSettings,
    SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows, SimulatedSettings,
    SimultaneousEstimate, SimultaneousModel, SimultaneousSettings, maximum_likelihood, simulated_least_squares,
    simultaneous_bound, simultaneous_least_squares,
};
pub use uncertainty::{CovarianceMethod, Estimate, EstimateStatus, correlation, student_half_width};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
