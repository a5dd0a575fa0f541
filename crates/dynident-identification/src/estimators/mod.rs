//! Estimators of base parameters from the rows of training logs, with their settings and findings.
//!
//! **To add an estimator**, change three files: add one here with its settings and a function from [`TrainingRows`] to
//! an [`Estimate`], add a variant of [`Estimator`], and add its name in the study file (`study/estimator.rs` of
//! `dynident`). The compiler reports the other places that need a change.

mod automatic;
mod band_motion;
mod error;
mod exogeneity;
mod function;
mod generalized;
mod instrument_rows;
mod instrumental;
mod instruments;
mod noise_in_regressor;
mod noise_weighted;
mod period_settings;
mod periodic_model;
mod robust;
mod row_pass;
mod settings;
mod simulated;
mod simulated_loop;
mod simultaneous;
mod spline_motion;
mod spline_torque;
mod start_values;

pub use error::EstimatorError;
pub use function::{EstimatorFunction, EstimatorRule};
pub use instrumental::InstrumentSettings;
pub use instruments::{InstrumentSource, SmoothedMotion};
pub use noise_in_regressor::{EstimateContrast, NoiseInRegressor, NoiseVerdict};
pub use noise_weighted::NoiseLevels;
pub use period_settings::{PeriodError, PeriodSettings, PeriodicFit};
pub use periodic_model::{FourierSeries, PeriodicModel, PeriodicRecord};
pub use robust::GrossErrors;
pub use settings::EstimationSettings;
pub use simulated::{SimulatedFit, SimulatedLoopSettings, SimulationStart};
pub use simultaneous::SeriesFit;
pub use spline_motion::SplineFit;
pub use spline_torque::SplineTorque;

use crate::consistent::ConsistencySettings;
use dynident_estimation::{
    Estimate, LinearProblem, RowWeight, SplineMotionSettings, ordinary_least_squares, weighted_least_squares,
};
use dynident_rows::{Logs, RegressorModel};
use simulated_loop::ComparedSignal;

/// Estimator of base parameters, with its settings.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub enum Estimator {
    /// Ordinary least squares: all joints have equal weights.
    Ordinary,
    /// Weighted least squares: joints are weighted by their noise.
    #[default]
    Weighted,
    /// Generalised least squares: takes the correlation between the errors of the joints at one instant into account.
    Generalized,
    /// Iteratively reweighted least squares with Huber's weights: rows with large residuals get less weight.
    Huber,
    /// Iteratively reweighted least squares with Tukey's weights: rows with very large residuals are ignored.
    Tukey,
    /// Least squares reweighted by the local noise level: noisy parts of a joint's rows get less weight.
    NoiseWeighted(NoiseLevels),
    /// Weighted least squares, or instrumental variables if noise in the regressor biases it and the instruments are
    /// strong.
    Auto(InstrumentSettings),
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental(InstrumentSettings),
    /// A function of the caller that uses the triangular factors of the rows.
    Function(EstimatorFunction),
    /// The same estimator as [`SplineMotion`](Self::SplineMotion), under the name of an earlier method for repeated
    /// motions.
    MaximumLikelihood(SplineMotionSettings),
    /// Estimates motion and parameters together, weighted by the noise of positions and torques. The motion must be a
    /// Fourier series.
    Simultaneous(PeriodSettings),
    /// Estimates motion and parameters together for any motion, which is described by a smoothing spline. The
    /// likelihood determines its smoothness.
    SplineMotion(SplineMotionSettings),
    /// Linear regression with the regressor of the simulated closed-loop motion, so that the regressor contains no
    /// measured positions (DIDIM).
    Didim(Box<SimulatedLoopSettings>),
    /// Fits the torque of the simulated closed loop to the measured torque (closed-loop input error, CLIE).
    Clie(Box<SimulatedLoopSettings>),
    /// Fits the positions of the simulated closed loop to the measured positions (closed-loop output error, CLOE).
    Cloe(Box<SimulatedLoopSettings>),
}

impl Estimator {
    /// Name of the estimator in files and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ordinary => "ordinary",
            Self::Weighted => "weighted",
            Self::Generalized => "generalized",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
            Self::NoiseWeighted(_) => "noise-weighted",
            Self::Auto(_) => "auto",
            Self::Instrumental(_) => "instrumental",
            Self::Function(_) => "function",
            Self::MaximumLikelihood(_) => "maximum-likelihood",
            Self::Simultaneous(_) | Self::SplineMotion(_) => "simultaneous",
            Self::Didim(_) => "didim",
            Self::Clie(_) => "clie",
            Self::Cloe(_) => "cloe",
        }
    }

    /// Whether the values are computed by least squares with one weight per joint. True for `Auto`, which starts with
    /// least squares.
    pub fn is_plain(&self) -> bool {
        match self {
            Self::Ordinary | Self::Weighted | Self::Auto(_) => true,
            Self::Generalized
            | Self::Huber
            | Self::Tukey
            | Self::NoiseWeighted(_)
            | Self::Instrumental(_)
            | Self::Function(_)
            | Self::MaximumLikelihood(_)
            | Self::Simultaneous(_)
            | Self::SplineMotion(_)
            | Self::Didim(_)
            | Self::Clie(_)
            | Self::Cloe(_) => false,
        }
    }
}

impl Estimator {
    /// Whether the estimator uses rows of the measured motion that are filtered like the torque. A lag that is
    /// estimated from such rows then also applies to this estimator.
    pub fn reads_filtered_rows(&self) -> bool {
        match self {
            Self::Ordinary
            | Self::Weighted
            | Self::Auto(_)
            | Self::Generalized
            | Self::Huber
            | Self::Tukey
            | Self::Function(_)
            | Self::NoiseWeighted(_) => true,
            Self::Instrumental(_)
            | Self::MaximumLikelihood(_)
            | Self::Simultaneous(_)
            | Self::SplineMotion(_)
            | Self::Didim(_)
            | Self::Clie(_)
            | Self::Cloe(_) => false,
        }
    }
}

/// Findings of an estimator in addition to the estimate. The list is exhaustive, so that the compiler reports a new
/// kind to code that writes results.
#[derive(Clone, Debug, Default)]
pub enum Findings {
    /// No findings.
    #[default]
    None,
    /// Weights of the rows in a robust estimator.
    GrossErrors(GrossErrors),
    /// Correlation of the joints' errors at one instant.
    NoiseCorrelation(Vec<Vec<f64>>),
    /// Lowest and highest noise level of each joint's rows, Nm (N).
    NoiseLevels(Vec<[f64; 2]>),
    /// Fourier motion and noise of every training log, from the simultaneous fit.
    Series(Vec<SeriesFit>),
    /// Spline motion and noise of every training log.
    Spline(SplineFit),
    /// Fit to a simulated closed loop.
    Simulated(SimulatedFit),
}

/// Base parameters with their covariance, and findings.
#[derive(Clone, Debug)]
pub struct Estimation {
    /// The estimate.
    pub estimate: Estimate,
    /// Findings of the estimator.
    pub findings: Findings,
    /// Comparison of least squares with instrumental variables; `None` if not made.
    pub noise_in_regressor: Option<NoiseInRegressor>,
}

impl Estimation {
    /// An estimate without findings.
    pub fn plain(estimate: Estimate) -> Self {
        Self { estimate, findings: Findings::None, noise_in_regressor: None }
    }
}

/// Rows for the estimation: as triangular factors, and as logs for estimators that read the rows again.
#[derive(Clone, Copy, Debug)]
pub struct TrainingRows<'a> {
    /// All recordings of the task.
    pub logs: &'a Logs<'a>,
    /// Model of the rows.
    pub model: &'a RegressorModel,
    /// Training recordings, in the order of the problem's logs.
    pub training: &'a [usize],
    /// The rows as triangular factors.
    pub problem: &'a LinearProblem,
    /// Estimator and error bars.
    pub settings: &'a EstimationSettings,
    /// Prior knowledge of the bodies, for simulations that start at a physically consistent set.
    pub consistency: Option<&'a ConsistencySettings>,
}

impl TrainingRows<'_> {
    pub(crate) fn begin(&self, stage: &str) {
        self.logs.begin(stage, self.training);
    }
}

/// Computes the estimate. If requested, tests the effect of noise in the regressor on least squares, with instruments
/// from `source` or from the logs' own motion.
///
/// # Errors
/// The rows do not determine an estimate, or a requirement of the estimator is not met.
pub fn estimate(
    rows: &TrainingRows<'_>,
    source: Option<&mut dyn InstrumentSource>,
) -> Result<Estimation, EstimatorError> {
    let settings = rows.settings;
    if let Some(source) = source {
        return with_source(rows, source);
    }
    let weighted = || weighted_least_squares(rows.problem, &settings.weighted());
    match &settings.estimator {
        Estimator::Instrumental(own) => {
            let (found, noise) = exogeneity::examined(rows, own, &weighted()?)?;
            return Ok(Estimation { noise_in_regressor: Some(noise), ..Estimation::plain(found.estimate) });
        }
        Estimator::Auto(own) => return automatic::automatic(rows, own, weighted()?),
        _ => {}
    }
    let (estimate, findings) = without_instruments(rows)?;
    let mut estimation = Estimation { findings, ..Estimation::plain(estimate) };
    // An instrumental-variables estimate is always compared with least squares.
    let compared = if settings.estimator.is_plain() { None } else { Some(weighted) };
    let least_squares = || compared.map_or_else(|| Ok(estimation.estimate.clone()), |weighted| weighted());
    estimation.noise_in_regressor = match &settings.exogeneity_test {
        Some(own) => Some(exogeneity::examined(rows, own, &least_squares()?)?.1),
        None if settings.examine_exogeneity => {
            let own = InstrumentSettings::default();
            automatic::examined_where_possible(rows, &own, &least_squares()?)?.map(|(_, noise)| noise)
        }
        None => None,
    };
    Ok(estimation)
}

fn with_source(rows: &TrainingRows<'_>, source: &mut dyn InstrumentSource) -> Result<Estimation, EstimatorError> {
    let settings = rows.settings;
    let own = match &settings.estimator {
        Estimator::Instrumental(own) | Estimator::Auto(own) => Some(own),
        _ => settings.exogeneity_test.as_ref(),
    };
    let (found, noise) = instrumental::with_instruments(rows, &own.cloned().unwrap_or_default(), source)?;
    let (estimate, findings) = match &settings.estimator {
        Estimator::Instrumental(_) => (found.estimate, Findings::None),
        _ => without_instruments(rows)?,
    };
    Ok(Estimation { estimate, findings, noise_in_regressor: Some(noise) })
}

fn without_instruments(rows: &TrainingRows<'_>) -> Result<(Estimate, Findings), EstimatorError> {
    let settings = rows.settings;
    let simulated = |loop_settings, compared| {
        let found = simulated::simulated(rows, loop_settings, compared);
        found.map(|(estimate, found)| (estimate, Findings::Simulated(found)))
    };
    Ok(match &settings.estimator {
        Estimator::Ordinary => (ordinary_least_squares(rows.problem, &settings.ordinary())?, Findings::None),
        Estimator::Weighted | Estimator::Auto(_) | Estimator::Instrumental(_) => {
            (weighted_least_squares(rows.problem, &settings.weighted())?, Findings::None)
        }
        Estimator::Function(own) => (own.estimate(rows)?, Findings::None),
        Estimator::Huber => robust::robust(rows, RowWeight::huber())?,
        Estimator::Tukey => robust::robust(rows, RowWeight::tukey())?,
        Estimator::Generalized => generalized::generalized(rows)?,
        Estimator::NoiseWeighted(levels) => noise_weighted::noise_weighted(rows, levels)?,
        Estimator::Simultaneous(periods) => simultaneous::simultaneous(rows, periods)?,
        Estimator::SplineMotion(settings) | Estimator::MaximumLikelihood(settings) => {
            spline_motion::spline_motion(rows, settings)?
        }
        Estimator::Didim(settings) => simulated(settings, ComparedSignal::TorqueRows)?,
        Estimator::Clie(settings) => simulated(settings, ComparedSignal::Torque)?,
        Estimator::Cloe(settings) => simulated(settings, ComparedSignal::Position)?,
    })
}
