//! `[estimator]`: how the parameters are estimated, and how far they are trusted.

use super::Code;
use super::physical::PhysicalChoice;
use super::simulated::SimulatedSection;
use crate::error::{Error, Expected, StudyError};
use dynident_estimation::{CovarianceMethod, EssentialSettings, RankSettings, SegmentSettings, SplineMotionSettings};
use dynident_identification::EstimationSettings;
use dynident_identification::estimators::{
    Estimator, EstimatorFunction, EstimatorRule, InstrumentSettings, NoiseLevels, PeriodSettings, SimulatedLoopSettings,
};
use serde::{Deserialize, Serialize};

/// How base parameters are estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum EstimatorMethod {
    /// Weighted least squares, or instrumental variables where noise in the regressor biases it and the logs' own
    /// smoother motion makes strong instruments.
    #[default]
    Auto,
    /// Ordinary least squares: every joint's newton metre counts alike.
    Ordinary,
    /// Weighted least squares: every joint counts by its own noise.
    Weighted,
    /// Generalised least squares: errors of the joints at one instant are correlated.
    Generalized,
    /// Iteratively reweighted with Huber's weights: rows far off count less.
    Huber,
    /// Iteratively reweighted with Tukey's weights: rows far off do not count.
    Tukey,
    /// Reweighted by the noise around every row: noisy stretches of a joint count less.
    NoiseWeighted,
    /// Instrumental variables: noise in the regressor does not bias the estimate.
    Instrumental,
    /// A caller's own function of the rows: no file holds its code.
    Function,
    /// Maximum likelihood for a motion that repeats: noise of motion and torque from how the periods differ.
    MaximumLikelihood,
    /// Motion and parameters together: noise of positions and torques weighed against each other. The motion is a
    /// smoothing spline, or, with `periods`, a Fourier series.
    Simultaneous,
    /// Regression on the motion of the simulated closed loop: no measured position enters the regressor.
    Didim,
    /// The simulated closed loop's torque fitted to the measured one (closed-loop input error).
    Clie,
    /// The simulated closed loop's positions fitted to the measured ones (closed-loop output error).
    Cloe,
}

impl EstimatorMethod {
    /// Whether it is least squares on the rows of the logs, or begins with it.
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
    /// What the function of `method = "function"` is called; its code is given by the program that has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub function: Option<String>,
    /// The code of `function`.
    #[serde(skip)]
    pub code: Code<dyn EstimatorRule>,
    /// The covariance that error bars come from; `"jackknife"`, which accounts for coloured residuals and judges each
    /// time segment by the fit without it, by default.
    pub covariance: CovarianceMethod,
    /// Whether the bodies, friction and drives written are those of a physically consistent set that fit the logs best
    /// (true by default), or the set nearest to the description that has exactly the estimated base parameters. A table
    /// in place of `true` says what else is known of the bodies.
    pub physical: PhysicalChoice,
    /// Intervals for every parameter of bodies and laws over all physically consistent robots that the data do not
    /// reject; some thousand physical fits, so not by default. Needs `physical`.
    pub intervals: bool,
    /// When a column counts as excited.
    pub rank: RankSettings,
    /// How logs are cut into segments for the covariance.
    pub segments: SegmentSettings,
    /// Hold parameters that the data hardly determine at zero; not by default.
    pub essential: Option<EssentialSettings>,
    /// Instruments for `method = "auto"` and `"instrumental"`. With another method they only test whether noise in the
    /// regressor biases least squares, which `"weighted"` and `"ordinary"` do by default.
    pub instruments: Option<InstrumentSettings>,
    /// How `method = "noise-weighted"` finds the noise around a row.
    pub noise_levels: NoiseLevels,
    /// The repeated motion of `method = "maximum-likelihood"`; of `"simultaneous"` where the motion is a Fourier
    /// series.
    pub periods: PeriodSettings,
    /// The motion of `method = "simultaneous"` where it is not said to repeat.
    pub spline: SplineMotionSettings,
    /// How the loop is simulated for `method = "didim"`, `"clie"` and `"cloe"`.
    pub simulated: SimulatedSection,
}

impl EstimatorSection {
    /// What all estimators share, with weighted least squares.
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

    /// The estimator that `method` names, with its settings; `simulated` is asked for the closed loop where it needs
    /// one.
    pub(crate) fn estimator(
        &self,
        simulated: impl FnOnce() -> Result<Box<SimulatedLoopSettings>, Error>,
    ) -> Result<Estimator, Error> {
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
            EstimatorMethod::MaximumLikelihood => Estimator::MaximumLikelihood(self.periods.clone()),
            EstimatorMethod::Simultaneous if self.has_series() => Estimator::Simultaneous(self.periods.clone()),
            EstimatorMethod::Simultaneous => Estimator::SplineMotion(self.spline.clone()),
            EstimatorMethod::Didim => Estimator::Didim(simulated()?),
            EstimatorMethod::Clie => Estimator::Clie(simulated()?),
            EstimatorMethod::Cloe => Estimator::Cloe(simulated()?),
        })
    }

    /// Whether `method = "simultaneous"` is told that the motion is a Fourier series.
    fn has_series(&self) -> bool {
        self.periods.period_s.is_some() || self.periods.harmonics.is_some()
    }

    /// Whether the method cannot do without the motion that was commanded.
    pub(crate) fn needs_commanded_motion(&self) -> bool {
        match self.method {
            EstimatorMethod::MaximumLikelihood => self.periods.period_s.is_none(),
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
            let fix = "they are of physically consistent parameters: take out physical = false";
            return Err(StudyError::conflict("estimator.intervals = true", fix));
        }
        self.segments.validate().map_err(StudyError::at("[estimator.segments]"))?;
        match &self.essential {
            Some(essential) => essential.validate().map_err(StudyError::at("[estimator.essential]")),
            None => Ok(()),
        }
    }
}
