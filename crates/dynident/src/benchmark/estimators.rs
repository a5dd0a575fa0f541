//! What the benchmark compares. **To add an estimator, add one line to [`ESTIMATORS`].**

use super::scenario::{Record, Scenario};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, EstimationError, LinearProblem, OrdinarySettings, WeightedSettings,
    ordinary_least_squares, weighted_least_squares,
};
use dynident_recording::MotionBlock;

/// One simulated experiment, as estimators see it.
#[derive(Debug)]
pub struct Trial<'a> {
    /// The machine and its excitation. Estimators may use the model's structure and the reference motion; its true parameters are for the judge.
    pub scenario: &'a Scenario,
    /// What encoders and torque sensors said.
    pub record: &'a Record,
    /// The record after the pipeline's own choice of cut-off and differentiator.
    pub motion: &'a MotionBlock,
    /// The pipeline's filtered rows as triangular factors.
    pub problem: &'a LinearProblem,
    /// Where an iterative estimator starts: the true base parameters with 15 % Gaussian error.
    pub start: &'a [f64],
}

/// What an estimator says.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The base parameters.
    pub values: Vec<f64>,
    /// Half the width of each value's 95 % interval; none if the estimator gives no error bars.
    pub half_width_95: Option<Vec<f64>>,
    /// False when the iterations stopped before they had settled: counts as a failure.
    pub converged: bool,
}

/// An entry of the registry.
#[derive(Clone, Copy, Debug)]
pub struct BenchmarkEstimator {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    pub(super) answer: fn(&Trial<'_>) -> Result<Answer, EstimationError>,
}

const fn entry(
    name: &'static str,
    what: &'static str,
    answer: fn(&Trial<'_>) -> Result<Answer, EstimationError>,
) -> BenchmarkEstimator {
    BenchmarkEstimator { name, what, answer }
}

/// The registry: one line for each estimator, or for each kind of error bar of one.
pub const ESTIMATORS: &[BenchmarkEstimator] = &[
    entry("ordinary", "ordinary least squares, jackknife error bars", |trial| {
        ordinary(trial, CovarianceMethod::Jackknife)
    }),
    entry("weighted", "weighted least squares, jackknife error bars", |trial| {
        weighted(trial, CovarianceMethod::Jackknife)
    }),
    entry("weighted-white", "the same, error bars for white residuals", |trial| {
        weighted(trial, CovarianceMethod::White)
    }),
    entry("weighted-segments", "the same, error bars from segments (CR1)", |trial| {
        weighted(trial, CovarianceMethod::Segments)
    }),
];

fn ordinary(trial: &Trial<'_>, covariance: CovarianceMethod) -> Result<Answer, EstimationError> {
    ordinary_least_squares(trial.problem, &OrdinarySettings { covariance, ..OrdinarySettings::default() }).map(answer)
}

fn weighted(trial: &Trial<'_>, covariance: CovarianceMethod) -> Result<Answer, EstimationError> {
    weighted_least_squares(trial.problem, &WeightedSettings { covariance, ..WeightedSettings::default() }).map(answer)
}

fn answer(estimate: Estimate) -> Answer {
    Answer {
        converged: estimate.status != EstimateStatus::IterationLimit,
        half_width_95: Some(estimate.half_width_95),
        values: estimate.values,
    }
}
