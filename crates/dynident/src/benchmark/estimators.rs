//! What the benchmark compares. **To add an estimator, add one line to [`ESTIMATORS`].**

use super::pipeline;
use super::scenario::{Record, Scenario};
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimateStatus, EstimationError, LinearProblem, OrdinarySettings, WeightedSettings,
    ordinary_least_squares, weighted_least_squares,
};
use dynident_excitation::Motion;
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
    /// The cut-off chosen from the record.
    pub cutoff_hz: f64,
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
    entry("weighted-newey-west", "the same, error bars by Newey and West", |trial| {
        weighted(trial, CovarianceMethod::NeweyWest)
    }),
    entry("weighted-bootstrap", "the same, error bars by block bootstrap", |trial| {
        weighted(trial, CovarianceMethod::Bootstrap)
    }),
    entry(
        "weighted-wide",
        "weighted least squares, cut-off twice the automatic one: what the differentiator's filter costs",
        wide,
    ),
    entry(
        "weighted-fourier",
        "weighted least squares, motion by a Fourier fit at the excitation's own frequencies",
        |trial| periodic(trial, Some(trial.cutoff_hz)),
    ),
    entry("weighted-fourier-all-rows", "the same on all rows, neither filtered nor decimated", |trial| {
        periodic(trial, None)
    }),
    entry(
        "weighted-true-motion",
        "weighted least squares on the true motion, which no one knows: what decimation costs",
        true_motion,
    ),
];

fn ordinary(trial: &Trial<'_>, covariance: CovarianceMethod) -> Result<Answer, EstimationError> {
    ordinary_least_squares(trial.problem, &OrdinarySettings { covariance, ..OrdinarySettings::default() }).map(answer)
}

fn weighted(trial: &Trial<'_>, covariance: CovarianceMethod) -> Result<Answer, EstimationError> {
    weighted_least_squares(trial.problem, &WeightedSettings { covariance, ..WeightedSettings::default() }).map(answer)
}

/// The fit to the record filtered at twice the automatic cut-off.
fn wide(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let cutoff_hz = 2.0 * trial.cutoff_hz;
    let motion = pipeline::differentiated(trial.record, cutoff_hz).map_err(|_| EstimationError::Empty)?;
    refitted(trial, &motion, Some(cutoff_hz))
}

/// The fit with the motion of a Fourier series: the excitation is periodic, and its frequencies are known.
fn periodic(trial: &Trial<'_>, cutoff_hz: Option<f64>) -> Result<Answer, EstimationError> {
    let motion = pipeline::periodic(trial.record).map_err(|_| EstimationError::Empty)?;
    refitted(trial, &motion, cutoff_hz)
}

/// The fit with the regressor of the true motion: an oracle that separates what differentiation costs from what decimation costs.
fn true_motion(trial: &Trial<'_>) -> Result<Answer, EstimationError> {
    let Motion { q, dq, ddq, .. } = trial.scenario.motion.clone();
    refitted(trial, &MotionBlock { q, dq, ddq, ..trial.motion.clone() }, Some(trial.cutoff_hz))
}

fn refitted(trial: &Trial<'_>, motion: &MotionBlock, cutoff_hz: Option<f64>) -> Result<Answer, EstimationError> {
    // A pipeline that fails is a failure of the estimator; the figure does not need the reason.
    let problem = pipeline::problem(trial.scenario, motion, cutoff_hz).map_err(|_| EstimationError::Empty)?;
    weighted_least_squares(&problem, &WeightedSettings::default()).map(answer)
}

fn answer(estimate: Estimate) -> Answer {
    Answer {
        converged: estimate.status != EstimateStatus::IterationLimit,
        half_width_95: Some(estimate.half_width_95),
        values: estimate.values,
    }
}
