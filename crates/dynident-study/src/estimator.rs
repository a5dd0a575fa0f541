//! `[estimator]`: estimation method and error bars.

use super::Code;
use super::physical::PhysicalChoice;
use super::simulated::SimulatedSection;
use crate::error::{Expected, StudyError, StudyFileError};
use dynident_estimation::{CovarianceMethod, EssentialSettings, RankSettings, SegmentSettings, SplineMotionSettings};
use dynident_identification::estimators::{
    Estimator, EstimatorFunction, EstimatorRule, InstrumentSettings, NoiseLevels, PeriodSettings, SimulatedLoopSettings,
};
use dynident_identification::{EstimationSettings, EventChoice};
use serde::{Deserialize, Serialize};

/// Estimation method for the base parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorMethod {
    /// Weighted least squares; instrumental variables if noise in the regressor biases the estimate and the smoothed
    /// motion of the logs makes strong instruments.
    #[default]
    Auto,
    /// Ordinary least squares: equal weight for all joints.
    Ordinary,
    /// Weighted least squares: each joint is weighted by its residual variance.
    Weighted,
    /// Generalised least squares: errors of different joints at one instant are correlated.
    Generalized,
    /// Iteratively reweighted least squares with Huber's weights: outliers get smaller weights.
    Huber,
    /// Iteratively reweighted least squares with Tukey's weights: large outliers get zero weight.
    Tukey,
    /// Reweighted by the local noise level of each row.
    NoiseWeighted,
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental,
    /// The caller's function of the rows; a study file cannot contain its code.
    Function,
    /// The same as `simultaneous` with a smoothing spline.
    MaximumLikelihood,
    /// Estimates motion and parameters together from noisy positions and torques. The motion is a smoothing spline, or
    /// a Fourier series if `periods` is given.
    Simultaneous,
    /// Regression on the motion of the simulated closed loop: measured positions do not enter the regressor.
    Didim,
    /// The simulated closed loop's torque fitted to the measured one (closed-loop input error).
    Clie,
    /// The simulated closed loop's positions fitted to the measured ones (closed-loop output error).
    Cloe,
}

impl EstimatorMethod {
    /// Whether it is least squares on the rows of the logs, or starts with it.
    pub(crate) fn is_least_squares(self) -> bool {
        match self {
            Self::Auto
            | Self::Ordinary
            | Self::Weighted
            | Self::Generalized
            | Self::Huber
            | Self::Tukey
            | Self::Function
            | Self::NoiseWeighted => true,
            Self::Instrumental
            | Self::MaximumLikelihood
            | Self::Simultaneous
            | Self::Didim
            | Self::Clie
            | Self::Cloe => false,
        }
    }

    /// The name in the study file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Ordinary => "ordinary",
            Self::Weighted => "weighted",
            Self::Generalized => "generalized",
            Self::Huber => "huber",
            Self::Tukey => "tukey",
            Self::NoiseWeighted => "noise-weighted",
            Self::Instrumental => "instrumental",
            Self::Function => "function",
            Self::MaximumLikelihood => "maximum-likelihood",
            Self::Simultaneous => "simultaneous",
            Self::Didim => "didim",
            Self::Clie => "clie",
            Self::Cloe => "cloe",
        }
    }
}

/// `[estimator]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct EstimatorSection {
    /// The method; `"auto"` by default.
    pub method: EstimatorMethod,
    /// Function name for `method = "function"`; the calling program provides the code.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub function: Option<String>,
    /// The code of `function`.
    #[serde(skip)]
    pub code: Code<dyn EstimatorRule>,
    /// Method of the covariance for error bars; `"jackknife"` by default, which accounts for coloured residuals: each
    /// time segment is predicted by a fit without it.
    pub covariance: CovarianceMethod,
    /// Whether exported bodies, friction and drives are the physically consistent set with the best fit to the logs
    /// (true by default), or the set nearest to the robot description that has exactly the estimated base parameters. A
    /// table in place of `true` adds constraints on the bodies.
    pub physical: PhysicalChoice,
    /// Whether to compute intervals of every body and friction parameter over all physically consistent robots that the
    /// data do not reject. This needs some thousand fits; false by default. Needs `physical`.
    pub intervals: bool,
    /// Rank decision: thresholds for excited columns.
    pub rank: RankSettings,
    /// Segmentation of the logs for the covariance.
    pub segments: SegmentSettings,
    /// Fixes poorly determined parameters at zero; off by default.
    pub essential: Option<EssentialSettings>,
    /// Search for intervals of the logs that no single model explains: contact, closed brakes, a joint on its stop, a
    /// change of load. `"auto"` (default) reports them and leaves out of the fit what no normal operation has: drives
    /// off, a joint on its stop, filled holes. `"set-aside"` leaves out every clear event, `"warn"` only
    /// reports, `"off"` does not search.
    pub events: EventChoice,
    /// Instruments for `method = "auto"` and `"instrumental"`. With other methods they only test whether noise in the
    /// regressor biases least squares; `"weighted"` and `"ordinary"` run this test by default.
    pub instruments: Option<InstrumentSettings>,
    /// Local noise estimate for `method = "noise-weighted"`.
    pub noise_levels: NoiseLevels,
    /// Period of the motion for `method = "simultaneous"` with a Fourier series.
    pub periods: PeriodSettings,
    /// Spline motion for `method = "simultaneous"` without `periods`, and for `"maximum-likelihood"`.
    pub spline: SplineMotionSettings,
    /// Simulation of the closed loop for `method = "didim"`, `"clie"` and `"cloe"`.
    pub simulated: SimulatedSection,
}

impl EstimatorSection {
    /// Settings shared by all estimators.
    pub(crate) fn common(&self) -> EstimationSettings {
        let mut settings = EstimationSettings::default();
        settings.examine_exogeneity = matches!(self.method, EstimatorMethod::Ordinary | EstimatorMethod::Weighted);
        if self.method != EstimatorMethod::Auto {
            settings.exogeneity_test.clone_from(&self.instruments);
        }
        (settings.rank, settings.covariance, settings.segments) = (self.rank, self.covariance, self.segments);
        settings.essential.clone_from(&self.essential);
        settings
    }

    /// Builds the estimator of `method` with its settings; `simulated` provides the closed loop if needed.
    pub(crate) fn estimator(
        &self,
        simulated: impl FnOnce() -> Result<Box<SimulatedLoopSettings>, StudyFileError>,
    ) -> Result<Estimator, StudyFileError> {
        Ok(match self.method {
            EstimatorMethod::Auto => Estimator::Auto(self.instruments.clone().unwrap_or_default()),
            EstimatorMethod::Ordinary => Estimator::Ordinary,
            EstimatorMethod::Weighted => Estimator::Weighted,
            EstimatorMethod::Generalized => Estimator::Generalized,
            EstimatorMethod::Huber => Estimator::Huber,
            EstimatorMethod::Tukey => Estimator::Tukey,
            EstimatorMethod::NoiseWeighted => Estimator::NoiseWeighted(self.noise_levels.clone()),
            EstimatorMethod::Function => Estimator::Function(EstimatorFunction {
                name: self.function.clone().unwrap_or_default(),
                rule: self.code.0.clone(),
            }),
            EstimatorMethod::Instrumental => Estimator::Instrumental(self.instruments.clone().unwrap_or_default()),
            EstimatorMethod::MaximumLikelihood => Estimator::MaximumLikelihood(self.spline.clone()),
            EstimatorMethod::Simultaneous if self.has_series() => Estimator::Simultaneous(self.periods.clone()),
            EstimatorMethod::Simultaneous => Estimator::SplineMotion(self.spline.clone()),
            EstimatorMethod::Didim => Estimator::Didim(simulated()?),
            EstimatorMethod::Clie => Estimator::Clie(simulated()?),
            EstimatorMethod::Cloe => Estimator::Cloe(simulated()?),
        })
    }

    /// Whether `method = "simultaneous"` models the motion as a Fourier series.
    fn has_series(&self) -> bool {
        self.periods.period_s.is_some() || self.periods.harmonics.is_some()
    }

    /// Whether the method requires the commanded motion.
    pub(crate) fn needs_commanded_motion(&self) -> bool {
        match self.method {
            EstimatorMethod::Simultaneous => self.has_series() && self.periods.period_s.is_none(),
            EstimatorMethod::Didim | EstimatorMethod::Clie | EstimatorMethod::Cloe => true,
            EstimatorMethod::Auto
            | EstimatorMethod::Ordinary
            | EstimatorMethod::Weighted
            | EstimatorMethod::Generalized
            | EstimatorMethod::Huber
            | EstimatorMethod::Tukey
            | EstimatorMethod::NoiseWeighted
            | EstimatorMethod::Function
            | EstimatorMethod::MaximumLikelihood
            | EstimatorMethod::Instrumental => false,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), StudyError> {
        if self.function.is_some() != (self.method == EstimatorMethod::Function) {
            let fix = "give estimator.method = \"function\" and estimator.function together, or neither";
            return Err(StudyError::conflict("estimator.function", fix));
        }
        self.rank.validate().map_err(StudyError::at("[estimator.rank]"))?;
        let instruments = self.instruments.clone().unwrap_or_default();
        let estimation = self.common();
        let (instrumental, hausman) = (instruments.instrumental(&estimation), instruments.hausman(&estimation));
        instrumental.validate().map_err(StudyError::at("[estimator.instruments]"))?;
        hausman.validate().map_err(StudyError::at("[estimator.instruments], test_level"))?;
        if let Some(cutoff) = instruments.cutoff_hz {
            Expected::Positive.check("estimator.instruments.cutoff_hz", cutoff)?;
        }
        let noise_levels = self.noise_levels.settings(&estimation);
        noise_levels.validate().map_err(StudyError::at("[estimator.noise_levels]"))?;
        self.periods.validate().map_err(StudyError::at("[estimator.periods]"))?;
        self.spline.validate().map_err(StudyError::at("[estimator.spline]"))?;
        self.simulated.validate().map_err(StudyError::at("[estimator.simulated]"))?;
        self.physical.validate().map_err(StudyError::at("[estimator.physical]"))?;
        if self.intervals && self.physical.settings().is_none() {
            let fix = "intervals need physically consistent parameters: remove physical = false";
            return Err(StudyError::conflict("estimator.intervals = true", fix));
        }
        self.segments.validate().map_err(StudyError::at("[estimator.segments]"))?;
        match &self.essential {
            Some(essential) => essential.validate().map_err(StudyError::at("[estimator.essential]")),
            None => Ok(()),
        }
    }
}
