//! From the rows of the training logs to base parameters: every estimator that is offered, with its settings and its
//! findings.
//!
//! **To add an estimator**, three files: one here with its settings and a function from [`TrainingRows`] to an
//! [`Estimate`]; a variant of [`Estimator`], which the compiler then asks for here; and its name in the study file
//! (`study/estimator.rs` of `dynident`), where the compiler asks for the rest.

mod automatic;
mod band_motion;
mod error;
mod exogeneity;
mod filtered_period;
mod function;
mod generalized;
mod instrument_rows;
mod instrumental;
mod instruments;
mod maximum_likelihood;
mod noise_in_regressor;
mod noise_weighted;
mod periodic_model;
mod robust;
mod row_pass;
mod settings;
mod simulated;
mod simulated_loop;
mod simultaneous;
mod spline_motion;
mod spline_torque;

pub use error::EstimatorError;
pub use function::{EstimatorFunction, EstimatorRule};
pub use instrumental::InstrumentSettings;
pub use instruments::{InstrumentSource, SmoothedMotion};
pub use maximum_likelihood::{PeriodError, PeriodSettings, PeriodicFit};
pub use noise_in_regressor::{EstimateContrast, NoiseInRegressor, NoiseVerdict};
pub use noise_weighted::NoiseLevels;
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

/// How base parameters are estimated, with the settings that belong to the estimator alone.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub enum Estimator {
    /// Ordinary least squares: every joint's newton metre counts alike.
    Ordinary,
    /// Weighted least squares: every joint counts by its own noise.
    #[default]
    Weighted,
    /// Generalised least squares: errors of the joints at one instant are correlated.
    Generalized,
    /// Iteratively reweighted with Huber's weights: rows far off count less.
    Huber,
    /// Iteratively reweighted with Tukey's weights: rows far off do not count.
    Tukey,
    /// Reweighted by the noise around every row: noisy stretches of a joint count less.
    NoiseWeighted(NoiseLevels),
    /// Weighted least squares, or instrumental variables where noise in the regressor biases it and the instruments are
    /// strong.
    Auto(InstrumentSettings),
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental(InstrumentSettings),
    /// A caller's own rule on the rows as factors.
    Function(EstimatorFunction),
    /// Maximum likelihood for a motion that repeats: noise of motion and torque from how the periods differ.
    MaximumLikelihood(PeriodSettings),
    /// Motion and parameters together, for a motion that is a Fourier series: noise of positions and torques weighed
    /// against each other.
    Simultaneous(PeriodSettings),
    /// The same for any motion, a smoothing spline whose smoothness comes from the likelihood.
    SplineMotion(SplineMotionSettings),
    /// Regression on the motion of the simulated closed loop: no measured position enters the regressor.
    Didim(Box<SimulatedLoopSettings>),
    /// The simulated closed loop's torque fitted to the measured one (closed-loop input error).
    Clie(Box<SimulatedLoopSettings>),
    /// The simulated closed loop's positions fitted to the measured ones (closed-loop output error).
    Cloe(Box<SimulatedLoopSettings>),
}

impl Estimator {
    /// The name in files and messages.
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

    /// Whether its values are those of least squares on the rows as they are, with one weight for each joint; of `Auto`
    /// before it has found noise.
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
    /// Whether it is made from rows of the measured motion, filtered as the torque is, so that a lag measured on these
    /// rows is the one that it suffers.
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

/// What an estimator alone can determine, beside its estimate. Exhaustive, so that whoever writes results is asked for
/// a new kind.
#[derive(Clone, Debug, Default)]
pub enum Findings {
    /// Nothing.
    #[default]
    None,
    /// How a robust estimator weighed the rows.
    GrossErrors(GrossErrors),
    /// Correlation of the joints' errors at one instant, joint by joint.
    NoiseCorrelation(Vec<Vec<f64>>),
    /// Lowest and highest noise level found around a row, joint by joint, Nm (N).
    NoiseLevels(Vec<[f64; 2]>),
    /// What the periods of a repeated motion say.
    Periodic(PeriodicFit),
    /// Motion and noise of every training log by the simultaneous fit.
    Series(Vec<SeriesFit>),
    /// Motion as a smoothing spline and noise of every training log.
    Spline(SplineFit),
    /// How the fit to a simulated closed loop went.
    Simulated(SimulatedFit),
}

/// Base parameters with their covariance, and what came out beside them.
#[derive(Clone, Debug)]
pub struct Estimation {
    /// The estimate.
    pub estimate: Estimate,
    /// What the estimator alone can determine.
    pub findings: Findings,
    /// Least squares against instruments, where there are any.
    pub noise_in_regressor: Option<NoiseInRegressor>,
}

impl Estimation {
    /// An estimate without findings.
    pub fn plain(estimate: Estimate) -> Self {
        Self { estimate, findings: Findings::None, noise_in_regressor: None }
    }
}

/// The rows that parameters are estimated from: as factors, and as logs for estimators that come back to the rows.
#[derive(Clone, Copy, Debug)]
pub struct TrainingRows<'a> {
    /// All recordings of the task.
    pub logs: &'a Logs<'a>,
    /// What makes their rows.
    pub model: &'a RegressorModel,
    /// Recordings to fit to, in the order of the problem's logs.
    pub training: &'a [usize],
    /// The rows as triangular factors.
    pub problem: &'a LinearProblem,
    /// The estimator, and how far what it gives is trusted.
    pub settings: &'a EstimationSettings,
    /// What is known of the bodies, for simulations that begin at a consistent set.
    pub consistency: Option<&'a ConsistencySettings>,
}

impl TrainingRows<'_> {
    pub(crate) fn begin(&self, stage: &str) {
        self.logs.begin(stage, self.training);
    }
}

/// The estimate that the settings ask for, and what noise in the regressor does to least squares where that is asked:
/// with instruments of `source`, or of the logs' own motion.
///
/// # Errors
/// Rows that do not carry an estimate, and what the estimator chosen needs and does not find.
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
    // What the instruments are compared with is least squares in any case.
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

/// As [`estimate`] with instruments from outside.
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

/// The estimate of estimators that need no instruments; of those that can do without, theirs without.
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
        Estimator::MaximumLikelihood(periods) => {
            let (estimate, found) = maximum_likelihood::periodic(rows, periods)?;
            (estimate, Findings::Periodic(found))
        }
        Estimator::Simultaneous(periods) => simultaneous::simultaneous(rows, periods)?,
        Estimator::SplineMotion(settings) => spline_motion::spline_motion(rows, settings)?,
        Estimator::Didim(settings) => simulated(settings, ComparedSignal::TorqueRows)?,
        Estimator::Clie(settings) => simulated(settings, ComparedSignal::Torque)?,
        Estimator::Cloe(settings) => simulated(settings, ComparedSignal::Position)?,
    })
}
