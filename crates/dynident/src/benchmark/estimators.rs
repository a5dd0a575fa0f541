//! What the benchmark compares. **To add an estimator, add one line to [`ESTIMATORS`].**

use super::answers::{
    generalized, instrumental, noise_weighted, ordinary, physical, robust, simultaneous, total, true_motion, weighted,
    wide,
};
use super::rows::Rows;
use super::scenario::{Record, Scenario};
use super::shared::Shared;
use dynident_estimation::{CovarianceMethod, EstimationError, LinearProblem, RowWeight};
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
    /// The pipeline's filtered rows.
    pub rows: &'a Rows<'a>,
    /// The same as triangular factors.
    pub problem: &'a LinearProblem,
    /// Where an iterative estimator starts: the true base parameters with 15 % Gaussian error.
    pub start: &'a [f64],
    /// A drawing office's idea of the machine: every body's ten true parameters times a common factor with 15 % Gaussian error, no friction and no drives.
    pub prior: &'a [f64],
    /// What several estimators need, made once.
    pub(super) shared: &'a Shared<'a>,
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
    entry("ordinary", "ordinary least squares, jackknife error bars", |trial| ordinary(trial.problem)),
    entry("weighted", "weighted least squares, jackknife error bars", |trial| {
        weighted(trial.problem, CovarianceMethod::Jackknife)
    }),
    entry("weighted-white", "the same, error bars for white residuals", |trial| {
        weighted(trial.problem, CovarianceMethod::White)
    }),
    entry("weighted-segments", "the same, error bars from segments (CR1)", |trial| {
        weighted(trial.problem, CovarianceMethod::Segments)
    }),
    entry("weighted-newey-west", "the same, error bars by Newey and West", |trial| {
        weighted(trial.problem, CovarianceMethod::NeweyWest)
    }),
    entry("weighted-bootstrap", "the same, error bars by block bootstrap", |trial| {
        weighted(trial.problem, CovarianceMethod::Bootstrap)
    }),
    entry(
        "weighted-wide",
        "weighted least squares, cut-off twice the automatic one: what the differentiator's filter costs",
        wide,
    ),
    entry(
        "weighted-true-motion",
        "weighted least squares on the true motion, which no one knows: what decimation costs",
        true_motion,
    ),
    entry("huber", "reweighted least squares with Huber's weights on the pipeline's rows", |trial| {
        robust(trial.rows, trial.problem, RowWeight::huber())
    }),
    entry("tukey", "the same with Tukey's weights", |trial| robust(trial.rows, trial.problem, RowWeight::tukey())),
    entry("noise-weighted", "rows weighted by the noise around them (Feng)", |trial| {
        noise_weighted(trial.rows, trial.problem)
    }),
    entry("generalized", "generalised least squares: joints' errors correlated", |trial| generalized(trial.rows)),
    entry("total-least-squares", "total least squares, columns' errors by propagation of the positions' noise", total),
    entry("instrumental", "instrumental variables, instruments from the reference motion", instrumental),
    entry(
        "weighted-fourier",
        "weighted least squares, motion by a Fourier fit at the excitation's own frequencies",
        |trial| weighted(&trial.shared.periodic_filtered(trial)?, CovarianceMethod::Jackknife),
    ),
    entry("weighted-fourier-all-rows", "the same on all rows, neither filtered nor decimated", |trial| {
        weighted(&trial.shared.periodic(trial)?.problem, CovarianceMethod::Jackknife)
    }),
    entry("huber-fourier-all-rows", "Huber's weights on those rows", |trial| {
        let periodic = trial.shared.periodic(trial)?;
        robust(&periodic.rows, &periodic.problem, RowWeight::huber())
    }),
    entry("tukey-fourier-all-rows", "Tukey's weights on those rows", |trial| {
        let periodic = trial.shared.periodic(trial)?;
        robust(&periodic.rows, &periodic.problem, RowWeight::tukey())
    }),
    entry("noise-weighted-fourier-all-rows", "those rows weighted by the noise around them", |trial| {
        let periodic = trial.shared.periodic(trial)?;
        noise_weighted(&periodic.rows, &periodic.problem)
    }),
    entry("physical", "the possible machine that fits those rows best", physical),
    entry(
        "simultaneous",
        "Fourier series of the motion and parameters from one likelihood, torque noise autoregressive",
        simultaneous,
    ),
];
