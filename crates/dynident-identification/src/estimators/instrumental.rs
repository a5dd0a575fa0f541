//! Instrumental variables, and the test of least squares against them.

use super::instrument_rows::instrumented_factors;
use super::instruments::{InstrumentSource, SmoothedMotion};
use super::{EstimationSettings, EstimatorError, TrainingRows};
use dynident_estimation::{
    HausmanSettings, HausmanTest, InstrumentReport, InstrumentalEstimate, InstrumentalSettings, InstrumentedProblem,
    hausman_test, instrumental_variables,
};
use serde::{Deserialize, Serialize};

/// Instruments from the motion of the log itself, smoothed far more strongly than for the regressor.
///
/// Noise above this cut-off is not in the instruments; what lies below it is, and is small where the motion is slow
/// against the noise.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct InstrumentSettings {
    /// Cut-off of the zero-phase Butterworth filter of fourth order; by default a quarter of what the log suggests for
    /// its motion, which is half of the highest frequency that stands out of the noise.
    pub cutoff_hz: Option<f64>,
    /// First-stage F below which instruments are called weak; 10 by default.
    pub weak_below: Option<f64>,
    /// Probability of rejecting least squares where it is right; 0.01 by default.
    pub test_level: Option<f64>,
}

impl InstrumentSettings {
    /// The estimator's settings.
    pub fn instrumental(&self, estimation: &EstimationSettings) -> InstrumentalSettings {
        let default = InstrumentalSettings::default();
        InstrumentalSettings {
            rank: estimation.rank,
            covariance: estimation.covariance,
            weak_below: self.weak_below.unwrap_or(default.weak_below),
            ..default
        }
    }

    /// The test's settings.
    pub fn hausman(&self, estimation: &EstimationSettings) -> HausmanSettings {
        let default = HausmanSettings::default();
        HausmanSettings {
            rank: estimation.rank,
            covariance: estimation.covariance,
            level: self.test_level.unwrap_or(default.level),
        }
    }
}

/// What was found out about noise in the regressor.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NoiseInRegressor {
    /// Lowest and highest cut-off of the instruments over the logs, Hz; none when they do not come from a filter.
    pub instrument_cutoff_hz: Option<[f64; 2]>,
    /// How well the instruments explain the regressor.
    pub instruments: InstrumentReport,
    /// Least squares against instruments: was filtering enough?
    pub hausman: HausmanTest,
}

/// With the logs' own motion, smoothed far more strongly, as instruments.
pub(super) fn with_smoothed_motion(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
) -> Result<(InstrumentalEstimate, NoiseInRegressor), EstimatorError> {
    let mut source = SmoothedMotion::new(rows.logs, rows.model.model(), settings);
    let (found, mut noise) = with_instruments(rows, settings, &mut source)?;
    noise.instrument_cutoff_hz = source.cutoffs_hz.iter().fold(None, |range: Option<[f64; 2]>, &cutoff| {
        Some(range.map_or([cutoff, cutoff], |[low, high]| [low.min(cutoff), high.max(cutoff)]))
    });
    Ok((found, noise))
}

/// The instrumental estimate and the test, with instruments from any source.
pub(super) fn with_instruments(
    rows: &TrainingRows<'_>,
    settings: &InstrumentSettings,
    source: &mut dyn InstrumentSource,
) -> Result<(InstrumentalEstimate, NoiseInRegressor), EstimatorError> {
    let (problem, estimation) = (rows.problem, rows.settings);
    let mut instrumented = InstrumentedProblem::new(problem.columns().to_vec(), problem.joints().to_vec())
        .with_fallback(problem.fallback().to_vec())?
        .with_unexcited(problem.unexcited().clone())?;
    rows.begin("instruments");
    for (place, &index) in rows.training.iter().enumerate() {
        let factors = instrumented_factors(rows, index, source)?;
        for (joint, factor) in factors.into_iter().enumerate() {
            let columns = rows.model.layout().joint_columns(joint);
            instrumented.add(&problem.logs()[place], joint, columns, factor)?;
        }
    }
    rows.logs.end();
    let found = instrumental_variables(&instrumented, &settings.instrumental(estimation))?;
    let hausman = hausman_test(&instrumented, &found, &settings.hausman(estimation))?;
    let instruments = found.instruments.clone();
    Ok((found, NoiseInRegressor { instrument_cutoff_hz: None, instruments, hausman }))
}
