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
    /// Weighted least squares. If noise in the regressor biases this estimate and the smoothed motion of the logs
    /// gives strong instruments, instrumental variables are used.
    #[default]
    Auto,
    /// Ordinary least squares: equal weight for all joints.
    Ordinary,
    /// Weighted least squares: each joint is weighted by its residual variance.
    Weighted,
    /// Generalised least squares: errors of different joints at the same instant are correlated.
    Generalized,
    /// Iteratively reweighted least squares with Huber's weights: outliers get smaller weights.
    Huber,
    /// Iteratively reweighted least squares with Tukey's weights: large outliers get zero weight.
    Tukey,
    /// Weighted least squares with the local noise level of each row.
    NoiseWeighted,
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental,
    /// A function of the calling program that processes the rows; a study file cannot contain its code.
    Function,
    /// The same as `simultaneous` with a smoothing spline as motion.
    MaximumLikelihood,
    /// Estimates motion and parameters together from noisy positions and torques. The motion is a smoothing spline, or
    /// a Fourier series if `periods` is given.
    Simultaneous,
    /// Direct and inverse dynamic identification (DIDIM): regression on the motion of the simulated closed loop.
    /// Measured positions do not enter the regressor.
    Didim,
    /// Closed-loop input error (CLIE): fits the torque of the simulated closed loop to the measured torque.
    Clie,
    /// Closed-loop output error (CLOE): fits the positions of the simulated closed loop to the measured positions.
    Cloe,
}

impl EstimatorMethod {
    /// Whether the method is least squares on the rows of the logs, or starts with it.
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

    /// Name in the study file.
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

/// Section `[estimator]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct EstimatorSection {
    /// Estimation method; `"auto"` by default.
    pub method: EstimatorMethod,
    /// Name of the function for `method = "function"`; the calling program provides the code.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub function: Option<String>,
    /// The code of `function`.
    #[serde(skip)]
    pub code: Code<dyn EstimatorRule>,
    /// Method of the covariance for error bars. Default `"jackknife"`, which is valid for residuals that are
    /// correlated in time: each time segment is predicted by a fit without this segment.
    pub covariance: CovarianceMethod,
    /// Whether exported bodies, friction and drives are the physically consistent parameters that fit the logs best
    /// (true, the default). If false, they are the set nearest to the robot description that has exactly the
    /// estimated base parameters. A table instead of `true` adds constraints on the bodies.
    pub physical: PhysicalChoice,
    /// Whether to compute intervals of every body and friction parameter over all physically consistent robots that
    /// the data do not reject. This takes some thousand fits and needs `physical`. False by default.
    pub intervals: bool,
    /// Thresholds that decide whether the logs excite a column.
    pub rank: RankSettings,
    /// Division of the logs into time segments for the covariance.
    pub segments: SegmentSettings,
    /// Criteria for fixing poorly determined parameters at zero; disabled by default.
    pub essential: Option<EssentialSettings>,
    /// Search for time intervals of the logs that no single model explains: contact, closed brakes, a joint at its
    /// mechanical stop, a change of payload. `"auto"` (default) reports them and excludes from the fit what does not
    /// occur in normal operation: disabled drives, a joint at its stop, interpolated gaps. `"set-aside"` excludes
    /// every clear event, `"warn"` only reports them, `"off"` does not search.
    pub events: EventChoice,
    /// Instruments for `method = "auto"` and `"instrumental"`. With other methods they are only used to test whether
    /// noise in the regressor biases least squares; `"weighted"` and `"ordinary"` do this test by default.
    pub instruments: Option<InstrumentSettings>,
    /// Estimation of the local noise for `method = "noise-weighted"`.
    pub noise_levels: NoiseLevels,
    /// Period of the motion for `method = "simultaneous"` with a Fourier series.
    pub periods: PeriodSettings,
    /// Motion as a spline, for `method = "simultaneous"` without `periods`, and for `"maximum-likelihood"`.
    pub spline: SplineMotionSettings,
    /// Simulation of the closed loop for `method = "didim"`, `"clie"` and `"cloe"`.
    pub simulated: SimulatedSection,
}

impl EstimatorSection {
    /// Settings that all estimators share.
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

    /// Builds the estimator for `method` with its settings; `simulated` provides the closed loop if the method needs
    /// it.
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
