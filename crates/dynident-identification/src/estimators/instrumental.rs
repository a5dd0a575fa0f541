//! Instrumental variables: settings, and the estimate with instruments from one source.

use super::band_motion::BandMotion;
use super::instrument_rows::{fast_motion_factors, instrumented_factors};
use super::instruments::{InstrumentSource, SmoothedMotion};
use super::noise_in_regressor::NoiseInRegressor;
use super::{EstimationSettings, EstimatorError, TrainingRows};
use dynident_estimation::{
    HausmanSettings, InstrumentalEstimate, InstrumentalSettings, InstrumentedProblem, LinearProblem, SegmentedFactor,
    Unexcited, hausman_test, instrumental_variables,
};
use dynident_rows::Samples;
use serde::{Deserialize, Serialize};

/// Settings of instrumental variables from the motion of the log itself, with a lower cut-off than in the regressor.
///
/// The instruments do not contain noise above their cut-off. Noise below it remains, but is small if the motion is slow
/// compared with the noise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentSettings {
    /// Cut-off of the zero-phase Butterworth filter of fourth order for the instruments, hertz. By default half of the
    /// regressor's cut-off, which still contains the motion. If noise is significant, the default is lowered as long as
    /// the estimate still changes.
    pub cutoff_hz: Option<f64>,
    /// First-stage F statistic below which instruments are weak; 10 by default.
    pub weak_below: Option<f64>,
    /// Probability that the test rejects least squares although it is correct; 0.01 by default.
    pub test_level: Option<f64>,
}

impl InstrumentSettings {
    /// Settings of the estimator.
    pub fn instrumental(&self, estimation: &EstimationSettings) -> InstrumentalSettings {
        let default = InstrumentalSettings::default();
        InstrumentalSettings {
            rank: estimation.rank,
            covariance: estimation.covariance,
            weak_below: self.weak_below.unwrap_or(default.weak_below),
            ..default
        }
    }

    /// Settings of the Hausman test.
    pub fn hausman(&self, estimation: &EstimationSettings) -> HausmanSettings {
        let default = HausmanSettings::default();
        HausmanSettings {
            rank: estimation.rank,
            covariance: estimation.covariance,
            level: self.test_level.unwrap_or(default.level),
        }
    }
}

pub(super) struct BandEstimate {
    pub(super) cutoff_hz: f64,
    pub(super) problem: InstrumentedProblem,
    pub(super) found: InstrumentalEstimate,
}

fn band_source<'r>(
    rows: &'r TrainingRows<'_>,
    index: usize,
    cutoff_hz: f64,
    most_samples: Option<u64>,
) -> Box<dyn InstrumentSource + 'r> {
    match rows.logs.recordings[index].samples {
        Samples::Log(_) => Box::new(BandMotion::new(rows, cutoff_hz, most_samples)),
        // The instruments are computed from raw samples, if these are available.
        Samples::Motion(_) => Box::new(SmoothedMotion::new(rows.logs, rows.model.model(), cutoff_hz)),
    }
}

fn of_every_log<T: Send>(
    rows: &TrainingRows<'_>,
    one: impl Fn(usize) -> Result<T, EstimatorError> + Sync,
) -> Result<Vec<T>, EstimatorError> {
    rows.begin("instruments");
    let of_logs = rows.logs.execution.try_map(rows.training, |&index| one(index));
    rows.logs.end();
    of_logs
}

/// For the test of the fast motion: maximum number of samples of all logs, and minimum number per log. The test
/// estimates only one coefficient, so minutes of recording are sufficient, and memory does not grow with the length of
/// a log.
const FAST_MOTION_SAMPLES: [u64; 2] = [200_000, 20_000];

/// Least-squares problem `τ − Z θ = κ (W − Z) θ` with a single unknown κ, and `‖(W − Z) θ‖²` of each joint. The
/// regressor Z uses the logs' motion below `cutoff_hz`, the regressor W the complete motion. Only the beginning of a
/// long log is used; the squares are scaled to the number of rows of the complete problem.
pub(super) fn fast_motion_problem(
    rows: &TrainingRows<'_>,
    cutoff_hz: f64,
    theta: &[f64],
) -> Result<(LinearProblem, Vec<f64>), EstimatorError> {
    let most = (FAST_MOTION_SAMPLES[0] / rows.training.len().max(1) as u64).max(FAST_MOTION_SAMPLES[1]);
    let logs = of_every_log(rows, |index| {
        let source = &mut *band_source(rows, index, cutoff_hz, Some(most));
        fast_motion_factors(rows, index, theta, Some(most), source)
    })?;
    let mut problem = LinearProblem::new(vec!["fast motion".to_owned()], rows.problem.joints().to_vec());
    let mut squares = vec![0.0; rows.problem.joints().len()];
    for (log, (factors, of_log)) in rows.problem.logs().iter().zip(logs) {
        squares.iter_mut().zip(of_log).for_each(|(sum, square)| *sum += square);
        for (joint, factor) in factors.into_iter().enumerate() {
            problem.add(log, joint, vec![0], factor)?;
        }
    }
    let counts = rows.problem.joint_rows().into_iter().zip(problem.joint_rows());
    for (square, (all, counted)) in squares.iter_mut().zip(counts).filter(|(_, (all, counted))| counted < all) {
        *square *= all as f64 / counted.max(1) as f64;
    }
    Ok((problem, squares))
}

/// Estimate with the logs' motion below `cutoff_hz` as instruments.
pub(super) fn with_band(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    cutoff_hz: f64,
) -> Result<BandEstimate, EstimatorError> {
    let factors =
        of_every_log(rows, |index| instrumented_factors(rows, index, &mut *band_source(rows, index, cutoff_hz, None)))?;
    let problem = instrumented_problem(rows, factors)?;
    let found = instrumental_variables(&problem, &settings.instrumental(rows.settings))?;
    Ok(BandEstimate { cutoff_hz, problem, found })
}

/// The instrumental-variables estimate and the test of least squares, with instruments from any source.
pub(super) fn with_instruments(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    source: &mut dyn InstrumentSource,
) -> Result<(InstrumentalEstimate, NoiseInRegressor), EstimatorError> {
    rows.begin("instruments");
    let factors = rows.training.iter().map(|&index| instrumented_factors(rows, index, source));
    // External instruments do not contain this position noise, so they alone determine which columns are excited.
    let problem =
        instrumented_problem(rows, factors.collect::<Result<Vec<_>, _>>()?)?.with_unexcited(Unexcited::default())?;
    rows.logs.end();
    let found = instrumental_variables(&problem, &settings.instrumental(rows.settings))?;
    let hausman = hausman_test(&problem, &found, &settings.hausman(rows.settings))?;
    let noise = NoiseInRegressor::of_test(found.instruments.clone(), hausman);
    Ok((found, noise))
}

/// Rows of all logs with one set of columns; `factors` contains one list for each training log.
fn instrumented_problem(
    rows: &TrainingRows<'_>,
    factors: Vec<Vec<SegmentedFactor>>,
) -> Result<InstrumentedProblem, EstimatorError> {
    let problem = rows.problem;
    let mut instrumented = InstrumentedProblem::new(problem.columns().to_vec(), problem.joints().to_vec())
        .with_fallback(problem.fallback().to_vec())?
        .with_unexcited(problem.unexcited().clone())?;
    for (log, factors) in problem.logs().iter().zip(factors) {
        for (joint, factor) in factors.into_iter().enumerate() {
            instrumented.add(log, joint, rows.model.layout().joint_columns(joint), factor)?;
        }
    }
    Ok(instrumented)
}
