//! **What do the measurements say?** From rows `[W | τ]` of numbers to parameters with error bars.
//!
//! This crate never knows where samples came from: it sees columns, joints and numbers. Rows of each joint in each log
//! go into a [`SegmentedFactor`] and are forgotten; the factors make a [`LinearProblem`] over named columns; an
//! estimator makes an [`Estimate`] of it: values, a covariance that accounts for residuals correlated in time, the
//! noise of every joint, and what was decided about columns that the data do not excite.
//!
//! ```
//! use dynident_estimation::*;
//! // Rows τ = 2 w − 0.5 + noise of one joint, given column by column, the torque last.
//! let w: Vec<f64> = (0..400).map(|k| (0.05 * f64::from(k)).sin()).collect();
//! let tau: Vec<f64> = w.iter().enumerate().map(|(k, w)| 2.0 * w - 0.5 + 0.1 * (k as f64 * 2.4).cos()).collect();
//! let mut rows = SegmentedFactor::new(2, SegmentSettings::for_rows(400))?;
//! rows.absorb(&[w, vec![1.0; 400], tau].concat(), 400)?;
//!
//! let mut problem = LinearProblem::new(vec!["viscous".into(), "offset".into()], vec!["joint1".into()]);
//! problem.add("run 1", 0, vec![0, 1], rows)?;
//! let estimate = weighted_least_squares(&problem, &WeightedSettings::default())?;
//! assert!((estimate.values[0] - 2.0).abs() <= 3.0 * estimate.std[0]);
//! assert_eq!(estimate.status, EstimateStatus::Complete);
//! # Ok::<(), EstimationError>(())
//! ```
//!
//! | what you want | where |
//! | --- | --- |
//! | parameters, noise of every joint unknown | [`weighted_least_squares`] |
//! | gross errors set aside | [`robust_least_squares`] |
//! | noise in position as well as in torque | [`instrumental_variables`], [`hausman_test`] |
//! | the motion estimated as well | [`spline_motion_least_squares`], [`simultaneous_least_squares`], [`maximum_likelihood`] |
//! | a simulation that looks like the record | [`simulated_least_squares`] |
//! | errors correlated between joints | [`generalized_least_squares`] |
//! | errors uneven in time | [`noise_weighted_least_squares`] |
//! | torque constants of the drives | [`joint_gains`] |
//! | other error bars | [`CovarianceMethod`] |
//! | bodies and friction that can be real | [`consistent::physical_fit`] |
//! | how far a body's parameters can be off | [`consistent::ConsistentIntervals`] |
//! | only the parameters that the data need | [`essential`] |
//! | errors on motion that was not used | [`Validation`], [`CrossValidation`] |
//! | what the residuals look like | [`Whiteness`], [`Normality`], [`SpeedRanges`] |
//!
//! The modules, from the bottom up: [`factor`] (rows to triangles, problems, rank), [`uncertainty`] (the estimate and
//! its covariance), [`linear`] and [`nonlinear`] estimators, [`consistent`] (bodies that can be real) and
//! [`diagnostics`]. Types that are only part of a result live there; what an identification needs is at the root as
//! well.

#![forbid(unsafe_code)]

pub mod consistent;
pub mod diagnostics;
mod error;
pub mod factor;
pub mod fleet;
pub mod linear;
pub mod nonlinear;
pub mod uncertainty;

pub use diagnostics::{
    CorrelatedPair, CrossValidation, EssentialEnd, EssentialReport, EssentialSettings, FoldErrors, JointFolds,
    Normality, NormalityReport, SpeedRanges, SpeedRangesReport, Validation, ValidationReport, Whiteness,
    WhitenessReport, essential, left_out_ratios, nonnegative_least_squares, strongest_correlations,
};
pub use error::EstimationError;
pub use factor::{
    FactorShape, FactorWorkspace, InstrumentedProblem, JointRows, LinearProblem, Prior, RankSettings, RecursiveFactor,
    SegmentSettings, SegmentShape, SegmentedFactor, TriangularFactor, Unexcited, unexcited_columns,
};
pub use linear::{
    CrossProblem, EstimatorRows, FastMotion, GainProblem, GeneralizedEstimate, HausmanSettings, HausmanTest,
    HausmanVerdict, InstrumentReport, InstrumentalEstimate, InstrumentalSettings, JointGain, KnownColumns,
    NoiseLevelSettings, NoiseWeightedEstimate, OrdinarySettings, OwnEstimate, RobustEstimate, RobustSettings, RowBlock,
    RowVisitor, RowWeight, WeightedSettings, WeightedValues, estimate_by, fast_motion, generalized_least_squares,
    hausman_test, instrumental_variables, joint_gains, noise_weighted_least_squares, ordinary_least_squares,
    robust_least_squares, weighted_least_squares, weighted_least_squares_with_known, weighted_values,
};
pub use nonlinear::{
    ChannelNoise, ChannelRows, InstantRows, InstantVisitor, MaximumLikelihoodEstimate, MaximumLikelihoodSettings,
    SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows, SimulatedSettings,
    SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings, SplineJointFit, SplineLogFit,
    SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord, TorqueModel, TorqueSlopes,
    maximum_likelihood, simulated_least_squares, simultaneous_bound, simultaneous_least_squares,
    spline_motion_least_squares,
};
pub use uncertainty::{CovarianceMethod, Estimate, EstimateStatus, HALF_WIDTH_95, correlation, student_half_width};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
