//! Estimators of base parameters from the rows of training logs, with their settings and findings.
//!
//! **To add an estimator**, three files: one here with its settings and a function from [`TrainingRows`] to an
//! [`Estimate`]; a variant of [`Estimator`]; and its name in the study file (`study/estimator.rs` of `dynident`). The
//! compiler reports the other places.

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

/// Method for the estimation of base parameters, with its settings.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub enum Estimator {
    /// Ordinary least squares: equal weights of all joints.
    Ordinary,
    /// Weighted least squares: joints are weighted by their noise.
    #[default]
    Weighted,
    /// Generalised least squares: errors of the joints at one instant are correlated.
    Generalized,
    /// Iteratively reweighted least squares with Huber's weights: outliers get less weight.
    Huber,
    /// Iteratively reweighted least squares with Tukey's weights: outliers are ignored.
    Tukey,
    /// Reweighted by the local noise level: noisy parts of a joint's rows get less weight.
    NoiseWeighted(NoiseLevels),
    /// Weighted least squares, or instrumental variables if noise in the regressor biases it and the instruments are
    /// strong.
    Auto(InstrumentSettings),
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental(InstrumentSettings),
    /// A caller's rule on the factors of the rows.
    Function(EstimatorFunction),
    /// The same as [`SplineMotion`](Self::SplineMotion), under the name of an earlier method for repeated motions.
    MaximumLikelihood(SplineMotionSettings),
    /// Motion and parameters together, for a motion that is a Fourier series, weighted by the noise of positions and
    /// torques.
    Simultaneous(PeriodSettings),
    /// The same for any motion, as a smoothing spline whose smoothness follows from the likelihood.
    SplineMotion(SplineMotionSettings),
    /// Regression on the motion of the simulated closed loop, without measured positions in the regressor.
    Didim(Box<SimulatedLoopSettings>),
    /// Fits the torque of the simulated closed loop to the measured torque (closed-loop input error).
    Clie(Box<SimulatedLoopSettings>),
    /// Fits the positions of the simulated closed loop to the measured positions (closed-loop output error).
    Cloe(Box<SimulatedLoopSettings>),
}

impl Estimator {
    /// Name in files and messages.
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

    /// Whether the values are those of least squares with one weight per joint; for `Auto` before it finds noise.
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
    /// Whether the estimator uses rows of the measured motion, filtered as the torque, so that a lag estimated from
    /// these rows applies to it.
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

/// Findings of an estimator in addition to its estimate. Exhaustive, so that the compiler reports a new kind to code
/// that writes results.
#[derive(Clone, Debug, Default)]
pub enum Findings {
    /// Nothing.
    #[default]
    None,
    /// Weights of the rows in a robust estimator.
    GrossErrors(GrossErrors),
    /// Correlation of the joints' errors at one instant.
    NoiseCorrelation(Vec<Vec<f64>>),
    /// Lowest and highest noise level of each joint's rows, Nm (N).
    NoiseLevels(Vec<[f64; 2]>),
    /// Motion and noise of every training log in the simultaneous fit.
    Series(Vec<SeriesFit>),
    /// Motion as a smoothing spline and noise of every training log.
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
    /// Comparison of least squares with instruments, if made.
    pub noise_in_regressor: Option<NoiseInRegressor>,
}

impl Estimation {
    /// An estimate without findings.
    pub fn plain(estimate: Estimate) -> Self {
        Self { estimate, findings: Findings::None, noise_in_regressor: None }
    }
}

/// Rows for the estimation: as factors, and as logs for estimators that read the rows again.
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
    /// Prior knowledge of the bodies, for simulations that start at a consistent set.
    pub consistency: Option<&'a ConsistencySettings>,
}

impl TrainingRows<'_> {
    pub(crate) fn begin(&self, stage: &str) {
        self.logs.begin(stage, self.training);
    }
}

/// Computes the estimate, and tests the effect of noise in the regressor on least squares if requested, with
/// instruments from `source` or from the logs' own motion.
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
    // Instruments are always compared with least squares.
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
