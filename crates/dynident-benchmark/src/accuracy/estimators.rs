//! Registry of the compared estimators. **To add an estimator, add one line to [`ESTIMATORS`].**

use super::answers::{
    estimated, instrumental, physical, robust, simultaneous, spline_motion, true_motion, weighted, wide,
};
use super::trial::{Answer, Trial};
use dynident_estimation::{CovarianceMethod, RowWeight};
use dynident_identification::IdentificationError;
use dynident_identification::estimators::{Estimator, NoiseLevels};

/// An entry of the registry.
#[derive(Clone, Copy, Debug)]
pub struct BenchmarkEstimator {
    /// Name on the command line.
    pub name: &'static str,
    /// Description.
    pub what: &'static str,
    pub(super) answer: fn(&Trial<'_>) -> Result<Answer, IdentificationError>,
}

const fn entry(
    name: &'static str,
    what: &'static str,
    answer: fn(&Trial<'_>) -> Result<Answer, IdentificationError>,
) -> BenchmarkEstimator {
    BenchmarkEstimator { name, what, answer }
}

/// The registry: one line per estimator, or per covariance method of an estimator.
pub const ESTIMATORS: &[BenchmarkEstimator] = &[
    entry("ordinary", "ordinary least squares, jackknife error bars", |trial| {
        estimated(trial.rows, Estimator::Ordinary, CovarianceMethod::Jackknife)
    }),
    entry("weighted", "weighted least squares, jackknife error bars", |trial| {
        weighted(trial.rows, CovarianceMethod::Jackknife)
    }),
    entry("weighted-white", "the same, error bars for white residuals", |trial| {
        weighted(trial.rows, CovarianceMethod::White)
    }),
    entry("weighted-segments", "the same, error bars from segments (CR1)", |trial| {
        weighted(trial.rows, CovarianceMethod::Segments)
    }),
    entry("weighted-newey-west", "the same, error bars by Newey and West", |trial| {
        weighted(trial.rows, CovarianceMethod::NeweyWest)
    }),
    entry("weighted-bootstrap", "the same, error bars by block bootstrap", |trial| {
        weighted(trial.rows, CovarianceMethod::Bootstrap)
    }),
    entry(
        "weighted-wide",
        "weighted least squares, cut-off twice the automatic one: shows the cost of the differentiator's filter",
        wide,
    ),
    entry(
        "weighted-true-motion",
        "weighted least squares on the true motion, which is unknown in practice: shows the cost of decimation",
        true_motion,
    ),
    entry("huber", "reweighted least squares with Huber's weights on the pipeline's rows", |trial| {
        robust(trial.rows, RowWeight::huber())
    }),
    entry("tukey", "the same with Tukey's weights", |trial| robust(trial.rows, RowWeight::tukey())),
    entry("noise-weighted", "rows weighted by the noise around them (Feng)", |trial| {
        estimated(trial.rows, Estimator::NoiseWeighted(NoiseLevels::default()), CovarianceMethod::Jackknife)
    }),
    entry("generalized", "generalised least squares: errors correlated between joints", |trial| {
        estimated(trial.rows, Estimator::Generalized, CovarianceMethod::default())
    }),
    entry("instrumental", "instrumental variables, instruments from the reference motion", instrumental),
    entry(
        "weighted-fourier",
        "weighted least squares, motion by a Fourier fit at the excitation's own frequencies",
        |trial| weighted(&trial.shared.periodic_filtered(trial)?, CovarianceMethod::Jackknife),
    ),
    entry("weighted-fourier-all-rows", "the same on all rows, neither filtered nor decimated", |trial| {
        weighted(trial.shared.periodic(trial)?, CovarianceMethod::Jackknife)
    }),
    entry("huber-fourier-all-rows", "Huber's weights on those rows", |trial| {
        robust(trial.shared.periodic(trial)?, RowWeight::huber())
    }),
    entry("tukey-fourier-all-rows", "Tukey's weights on those rows", |trial| {
        robust(trial.shared.periodic(trial)?, RowWeight::tukey())
    }),
    entry("noise-weighted-fourier-all-rows", "those rows weighted by the noise around them", |trial| {
        let rows = trial.shared.periodic(trial)?;
        estimated(rows, Estimator::NoiseWeighted(NoiseLevels::default()), CovarianceMethod::Jackknife)
    }),
    entry("physical", "best physically consistent fit to those rows", physical),
    entry(
        "simultaneous",
        "Fourier series of the motion and parameters from one likelihood, torque noise autoregressive",
        simultaneous,
    ),
    entry(
        "simultaneous-spline",
        "the same for any motion, a smoothing spline, without known excitation",
        spline_motion,
    ),
];
