//! **Estimation from rows `[W | τ]`** of regressor W and torque τ: parameters with error bars.
//!
//! The crate works on columns, joints and numbers; it does not depend on robots or file formats. The rows of each
//! joint in each log are reduced to a [`SegmentedFactor`]. The factors form a [`LinearProblem`] over named columns.
//! An estimator solves it and returns an [`Estimate`]: values, a covariance that is valid for residuals correlated in
//! time, the noise of every joint and the rank decisions for unexcited columns.
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
//! | task | item |
//! | --- | --- |
//! | parameters, noise of every joint unknown | [`weighted_least_squares`] |
//! | outlier-robust fit | [`robust_least_squares`] |
//! | noise in position as well as in torque | [`instrumental_variables`], [`hausman_test`] |
//! | joint estimate of motion and parameters | [`spline_motion_least_squares`], [`simultaneous_least_squares`] |
//! | fit of the simulated to the measured motion | [`simulated_least_squares`] |
//! | errors correlated between joints | [`generalized_least_squares`] |
//! | noise level that varies in time | [`noise_weighted_least_squares`] |
//! | torque constants of the drives | [`joint_gains`] |
//! | other error bars | [`CovarianceMethod`] |
//! | physically consistent bodies and friction | [`consistent::physical_fit`] |
//! | intervals of physically consistent parameters | [`consistent::ConsistentIntervals`] |
//! | removal of parameters that the data do not need | [`essential`] |
//! | parts of a robot that differ between two estimates | [`changes::explanations`] |
//! | validation on held-out motion | [`Validation`], [`CrossValidation`] |
//! | residual diagnostics | [`Whiteness`], [`Normality`], [`SpeedRanges`] |
//!
//! Modules from the bottom up: [`factor`] (triangular factors, problems, rank), [`uncertainty`] (estimate and
//! covariance), [`linear`] and [`nonlinear`] estimators, [`consistent`] (physical consistency) and [`diagnostics`].
//! The root re-exports the items that an identification needs; detail types of results remain in the modules.

#![forbid(unsafe_code)]

pub mod changes;
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
    CrossProblem, CustomEstimate, EstimatorRows, FastMotion, GainProblem, GeneralizedEstimate, HausmanSettings,
    HausmanTest, HausmanVerdict, InstrumentReport, InstrumentalEstimate, InstrumentalSettings, JointGain, KnownColumns,
    NoiseLevelSettings, NoiseWeightedEstimate, OrdinarySettings, RobustEstimate, RobustSettings, RowBlock, RowVisitor,
    RowWeight, WeightedSettings, WeightedValues, estimate_by, fast_motion, generalized_least_squares, hausman_test,
    instrumental_variables, joint_gains, noise_weighted_least_squares, ordinary_least_squares, robust_least_squares,
    weighted_least_squares, weighted_least_squares_with_known, weighted_values,
};
pub use nonlinear::{
    ChannelNoise, ChannelRows, SimulatedCriterion, SimulatedEstimate, SimulatedMotion, SimulatedProblem, SimulatedRows,
    SimulatedSettings, SimultaneousEstimate, SimultaneousModel, SimultaneousProblem, SimultaneousSettings,
    SplineJointFit, SplineLogFit, SplineMotionEstimate, SplineMotionProblem, SplineMotionSettings, SplineRecord,
    TorqueModel, TorqueSlopes, simulated_least_squares, simultaneous_bound, simultaneous_least_squares,
    spline_motion_least_squares,
};
pub use uncertainty::{
    CovarianceMethod, Estimate, EstimateStatus, HALF_WIDTH_95, correlation, normal_below, student_half_width,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
mod readme {}
