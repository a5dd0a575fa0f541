//! From the study's choice of an estimator to an estimate: some need the logs once more.

use crate::error::Error;
use crate::identify::further_passes::{generalized, noise_weighted, robust};
use crate::identify::instrument_rows::instrumented_factors;
use crate::identify::instruments::{InstrumentSection, InstrumentSource, SmoothedMotion};
use crate::identify::periodic::{PeriodicFit, periodic};
use crate::identify::simulated::{SimulatedFit, simulated};
use crate::job::RunOptions;
use crate::machine::Machine;
use crate::measured::rows::{Pass, estimated_rows};
use crate::study::{EstimatorMethod, EstimatorSection, Study};
use dynident_estimation::{
    Estimate, EstimationError, HausmanSettings, HausmanTest, InstrumentReport, InstrumentalEstimate,
    InstrumentalSettings, InstrumentedProblem, LinearProblem, OrdinarySettings, RowWeight, WeightedSettings,
    hausman_test, instrumental_variables, ordinary_least_squares, weighted_least_squares,
};
use dynident_recording::MotionSettings;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was found out about noise in the regressor.
#[derive(Clone, Debug, Serialize)]
pub struct NoiseInRegressor {
    /// Lowest and highest cut-off of the instruments over the logs, Hz; none when they do not come from a filter.
    pub instrument_cutoff_hz: Option<[f64; 2]>,
    /// How well the instruments explain the regressor.
    pub instruments: InstrumentReport,
    /// Least squares against instruments: was filtering enough?
    pub hausman: HausmanTest,
}

/// What a robust estimator thought of the rows, joint by joint.
#[derive(Clone, Debug, Serialize)]
pub struct GrossErrors {
    /// Share of rows whose weight is below one half.
    pub share: Vec<f64>,
    /// Mean weight of the rows.
    pub mean_weight: Vec<f64>,
}

/// An estimate and what its method alone can tell.
pub(crate) struct Fitted {
    pub(crate) estimate: Estimate,
    pub(crate) noise_in_regressor: Option<NoiseInRegressor>,
    pub(crate) gross_errors: Option<GrossErrors>,
    pub(crate) noise_correlation: Option<Vec<Vec<f64>>>,
    pub(crate) noise_levels: Option<Vec<[f64; 2]>>,
    pub(crate) periodic: Option<PeriodicFit>,
    pub(crate) simulated: Option<SimulatedFit>,
}

impl Fitted {
    /// An estimate that was made elsewhere.
    pub(crate) fn alone(estimate: Estimate) -> Self {
        Self {
            estimate,
            noise_in_regressor: None,
            gross_errors: None,
            noise_correlation: None,
            noise_levels: None,
            periodic: None,
            simulated: None,
        }
    }
}

/// The logs behind a fit, for estimators that pass them again.
pub(crate) struct Logs<'a> {
    pub(crate) study: &'a Study,
    pub(crate) path: &'a Path,
    pub(crate) machine: &'a Machine,
    pub(crate) motion: &'a MotionSettings,
    pub(crate) files: &'a [PathBuf],
    /// Logs to fit to, in the order of `problem`'s logs.
    pub(crate) training: &'a [usize],
    pub(crate) options: &'a RunOptions<'a>,
}

impl Logs<'_> {
    pub(crate) fn pass(&self, index: usize) -> Pass<'_> {
        Pass {
            study: self.study,
            machine: self.machine,
            motion: self.motion,
            index,
            file: &self.files[index],
            reader_thread: false,
            most_samples: None,
            progress: self.options.progress,
        }
    }

    pub(crate) fn in_study(&self, source: EstimationError) -> Error {
        Error::Estimation { path: self.path.to_owned(), source }
    }

    pub(crate) fn begin(&self, what: &str) {
        let rows = estimated_rows(self.training.iter().map(|&index| &*self.files[index]));
        self.options.progress.begin(what, rows);
    }
}

/// The estimate that the study asks for, and the test of least squares if there are instruments: those of `source`, or the study's own.
pub(crate) fn fitted(
    logs: &Logs<'_>,
    problem: &LinearProblem,
    source: Option<&mut dyn InstrumentSource>,
) -> Result<Fitted, Error> {
    let section = &logs.study.estimator;
    let EstimatorSection { rank, covariance, .. } = *section;
    let in_study = |source| logs.in_study(source);
    let choice = section.instruments.clone().unwrap_or_default();
    let instrumented = if let Some(source) = source {
        Some(with_instruments(logs, problem, &choice, source)?)
    } else if section.method == EstimatorMethod::Instrumental || section.instruments.is_some() {
        let mut source = SmoothedMotion::new(logs.study, logs.machine, logs.files, logs.motion, &choice);
        let (found, mut noise) = with_instruments(logs, problem, &choice, &mut source)?;
        noise.instrument_cutoff_hz = source.cutoffs_hz.iter().fold(None, |range: Option<[f64; 2]>, &cutoff| {
            Some(range.map_or([cutoff, cutoff], |[low, high]| [low.min(cutoff), high.max(cutoff)]))
        });
        Some((found, noise))
    } else {
        None
    };
    let (by_instruments, noise_in_regressor) = instrumented.unzip();
    let (mut gross_errors, mut noise_correlation, mut noise_levels) = (None, None, None);
    let (mut by_periods, mut by_simulation) = (None, None);
    let estimate = match section.method {
        EstimatorMethod::Ordinary => {
            ordinary_least_squares(problem, &OrdinarySettings { rank, covariance }).map_err(in_study)?
        }
        EstimatorMethod::Instrumental => {
            by_instruments.map(|found| found.estimate).ok_or_else(|| in_study(EstimationError::Empty))?
        }
        EstimatorMethod::Huber | EstimatorMethod::Tukey => {
            let tukey = section.method == EstimatorMethod::Tukey;
            let found = robust(logs, problem, if tukey { RowWeight::tukey() } else { RowWeight::huber() })?;
            gross_errors = Some(GrossErrors { share: found.outlier_share, mean_weight: found.mean_weight });
            found.estimate
        }
        EstimatorMethod::Generalized => {
            let found = generalized(logs, problem)?;
            let rows = found.noise_correlation.row_iter();
            noise_correlation = Some(rows.map(|row| row.iter().copied().collect()).collect());
            found.estimate
        }
        EstimatorMethod::NoiseWeighted => {
            let found = noise_weighted(logs, problem)?;
            noise_levels = Some(found.level_range);
            found.estimate
        }
        EstimatorMethod::MaximumLikelihood => {
            let (estimate, found) = periodic(logs, problem)?;
            by_periods = Some(found);
            estimate
        }
        EstimatorMethod::Didim | EstimatorMethod::Clie | EstimatorMethod::Cloe => {
            let (estimate, found) = simulated(logs, problem)?;
            by_simulation = Some(found);
            estimate
        }
        EstimatorMethod::Weighted => {
            let settings = WeightedSettings { rank, covariance, ..WeightedSettings::default() };
            weighted_least_squares(problem, &settings).map_err(in_study)?
        }
    };
    Ok(Fitted {
        estimate,
        noise_in_regressor,
        gross_errors,
        noise_correlation,
        noise_levels,
        periodic: by_periods,
        simulated: by_simulation,
    })
}

/// The instrumental estimate and the test, with instruments from any source.
fn with_instruments(
    logs: &Logs<'_>,
    problem: &LinearProblem,
    choice: &InstrumentSection,
    source: &mut dyn InstrumentSource,
) -> Result<(InstrumentalEstimate, NoiseInRegressor), Error> {
    let section = &logs.study.estimator;
    let in_study = |source| logs.in_study(source);
    let mut instrumented = InstrumentedProblem::new(problem.columns().to_vec(), problem.joints().to_vec())
        .with_fallback(problem.fallback().to_vec())
        .map_err(in_study)?;
    logs.begin("instruments");
    for (place, &index) in logs.training.iter().enumerate() {
        let factors = instrumented_factors(&logs.pass(index), source, section.segments)?;
        for (joint, factor) in factors.into_iter().enumerate() {
            let columns = logs.machine.layout().joint_columns(joint);
            instrumented.add(&problem.logs()[place], joint, columns, factor).map_err(in_study)?;
        }
    }
    logs.options.progress.end();
    let found = instrumental_variables(&instrumented, &instrumental_settings(section, choice)).map_err(in_study)?;
    let hausman = hausman_test(&instrumented, &found, &hausman_settings(section, choice)).map_err(in_study)?;
    let instruments = found.instruments.clone();
    Ok((found, NoiseInRegressor { instrument_cutoff_hz: None, instruments, hausman }))
}

/// The estimator's settings by the study.
pub(crate) fn instrumental_settings(section: &EstimatorSection, choice: &InstrumentSection) -> InstrumentalSettings {
    let default = InstrumentalSettings::default();
    InstrumentalSettings {
        rank: section.rank,
        covariance: section.covariance,
        weak_below: choice.weak_below.unwrap_or(default.weak_below),
        ..default
    }
}

/// The test's settings by the study.
pub(crate) fn hausman_settings(section: &EstimatorSection, choice: &InstrumentSection) -> HausmanSettings {
    let default = HausmanSettings::default();
    HausmanSettings {
        rank: section.rank,
        covariance: section.covariance,
        level: choice.test_level.unwrap_or(default.level),
    }
}
