//! Settings for the study key `differentiator`, with a variant for each differentiator.

use super::butterworth::{ButterworthZeroPhase, LowPass};
use super::central_differences::CentralDifferences;
use super::deviation::Deviation;
use super::differentiator::Differentiator;
use super::five_point_cubic::FivePointCubic;
use super::fourier_fit::FourierFit;
use super::frequency_domain::{Ends, FrequencyDomain};
use super::function::DifferentiatorCode;
use super::position_map::PositionMap;
use super::reference_lag::check_max_lag;
use super::savitzky_golay::SavitzkyGolay;
use super::smoothed_differences::SmoothedDifferences;
use super::time_warp::TimeWarp;
use super::velocity_series::VelocitySeries;
use crate::error::FilterError;
use crate::reference::{Reference, ReferenceSettings};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Type and settings of a differentiator, as in the study key `differentiator`.
///
/// ```
/// use dynident_recording::DifferentiatorSettings;
/// let settings: DifferentiatorSettings = toml::from_str("method = \"butterworth\"\ncutoff_hz = 8.0").unwrap();
/// assert_eq!(settings, DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(8.0) });
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "method", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum DifferentiatorSettings {
    /// [`ButterworthZeroPhase`]; without `cutoff_hz` the cut-off is estimated from the data
    /// ([`cutoff`](crate::cutoff())).
    Butterworth {
        /// Order of the one-way filter, 1 to 12; 4 by default.
        #[serde(default = "four")]
        order: usize,
        /// Cut-off, Hz; estimated from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`CentralDifferences`] of the logged positions.
    CentralDifferences {
        /// Order of accuracy: 2, 4, 6 or 8; 4 by default.
        #[serde(default = "four")]
        order: usize,
    },
    /// [`SavitzkyGolay`]: local polynomials.
    SavitzkyGolay {
        /// Odd number of samples.
        window: usize,
        /// Degree of the polynomial, 2 or more, below `window`; 4 by default.
        #[serde(default = "four")]
        degree: usize,
    },
    /// [`LowPass`]: a causal Butterworth filter, which delays position, velocity and acceleration.
    LowPass {
        /// Order, 1 to 12; 4 by default.
        #[serde(default = "four")]
        order: usize,
        /// Cut-off, Hz; estimated from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`FourierFit`]: a series fitted to the positions of the whole piece.
    FourierFit {
        /// Base frequency of the motion, Hz.
        base_hz: f64,
        /// Highest harmonic, 1 to 200.
        harmonics: usize,
        /// Whether to fit a straight line as well; true by default.
        #[serde(default = "yes")]
        trend: bool,
    },
    /// [`FrequencyDomain`]: multiplication by jω up to a cut-off.
    FrequencyDomain {
        /// Maximum frequency, Hz; estimated from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
        /// Extension of the signal beyond its ends; a smooth bridge by default.
        #[serde(default)]
        ends: Ends,
    },
    /// [`SmoothedDifferences`]: central differences; a moving average smooths acceleration and torque.
    SmoothedDifferences {
        /// Order of accuracy of the differences; 2 by default.
        #[serde(default = "two")]
        order: usize,
        /// Odd number of samples, 3 to 501.
        window: usize,
    },
    /// [`FivePointCubic`]: five-point cubic smoothing of the torque, low-pass filtered differences of the position.
    FivePointCubic {
        /// Number of smoothing passes over the torque; 1 by default.
        #[serde(default = "one")]
        passes: usize,
        /// Cut-off of the low-pass filter, Hz; estimated from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`VelocitySeries`]: a Fourier series fitted to the filtered velocity.
    #[serde(rename = "speed-series")]
    VelocitySeries {
        /// Base frequency of the motion, Hz.
        base_hz: f64,
        /// Highest harmonic, 1 to 200.
        harmonics: usize,
        /// Cut-off of the filter, Hz; estimated from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`PositionMap`]: velocity and acceleration from the position on a known stroke.
    #[serde(alias = "logistic-map")]
    PositionMap {
        /// Commanded motion; if the log has a reference, that one is used instead.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Maximum lag of a joint behind the commanded motion, s; 0.5 by default.
        #[serde(default = "half")]
        max_lag_s: f64,
    },
    /// [`TimeWarp`]: the commanded motion at a shifted time, with one lag per stroke.
    TimeWarp {
        /// Commanded motion; if the log has a reference, that one is used instead.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Maximum lag of a joint behind the commanded motion, s; 0.5 by default.
        #[serde(default = "half")]
        max_lag_s: f64,
    },
    /// A [`Differentiator`] that the caller implements; its code is not serialised.
    Function {
        /// Name in results.
        function: String,
        /// The code.
        #[serde(skip)]
        code: DifferentiatorCode,
    },
    /// [`Deviation`]: derivatives of the commanded motion plus derivatives of the smoothed deviation from it.
    Deviation {
        /// Commanded motion; if the log has a reference, that one is used instead.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Differentiator for the deviation: any that needs no commanded motion; zero-phase Butterworth by default.
        #[serde(default)]
        smoother: Box<DifferentiatorSettings>,
        /// Maximum lag by which the commanded motion is shifted, s; by default it is not shifted.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max_lag_s: Option<f64>,
    },
}

fn one() -> usize {
    1
}

fn two() -> usize {
    2
}

fn half() -> f64 {
    0.5
}

fn yes() -> bool {
    true
}

fn four() -> usize {
    4
}

impl Default for DifferentiatorSettings {
    fn default() -> Self {
        Self::Butterworth { order: four(), cutoff_hz: None }
    }
}

impl DifferentiatorSettings {
    /// Checks the settings, without a log and without reading the table of the commanded motion.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        if let Self::Function { .. } = self {
            return Ok(());
        }
        let Some(reference) = self.reference() else { return self.build(1.0).map(drop) };
        reference.validate()?;
        if let Self::PositionMap { max_lag_s, .. } | Self::TimeWarp { max_lag_s, .. } = self {
            check_max_lag(*max_lag_s)?;
        }
        if let Self::Deviation { smoother, max_lag_s, .. } = self {
            max_lag_s.map_or(Ok(()), check_max_lag)?;
            if smoother.reference().is_some() {
                let problem = "the smoother of a deviation must not need a reference itself".to_owned();
                return Err(FilterError::Reference { problem });
            }
            smoother.validate()?;
        }
        Ok(())
    }

    /// The commanded motion; `None` for differentiators that need none.
    pub fn reference(&self) -> Option<&ReferenceSettings> {
        match self {
            Self::PositionMap { reference, .. }
            | Self::TimeWarp { reference, .. }
            | Self::Deviation { reference, .. } => Some(reference),
            Self::Butterworth { .. }
            | Self::CentralDifferences { .. }
            | Self::SavitzkyGolay { .. }
            | Self::LowPass { .. }
            | Self::FourierFit { .. }
            | Self::FrequencyDomain { .. }
            | Self::SmoothedDifferences { .. }
            | Self::FivePointCubic { .. }
            | Self::VelocitySeries { .. }
            | Self::Function { .. } => None,
        }
    }

    fn cutoff_place(&mut self) -> Option<&mut Option<f64>> {
        match self {
            Self::Butterworth { cutoff_hz, .. }
            | Self::LowPass { cutoff_hz, .. }
            | Self::FrequencyDomain { cutoff_hz, .. }
            | Self::FivePointCubic { cutoff_hz, .. }
            | Self::VelocitySeries { cutoff_hz, .. } => Some(cutoff_hz),
            Self::Deviation { smoother, .. } => smoother.cutoff_place(),
            Self::CentralDifferences { .. }
            | Self::SavitzkyGolay { .. }
            | Self::FourierFit { .. }
            | Self::SmoothedDifferences { .. }
            | Self::PositionMap { .. }
            | Self::TimeWarp { .. }
            | Self::Function { .. } => None,
        }
    }

    /// Cut-off in the settings, Hz (for [`Deviation`], the cut-off of its smoother). `None` if it is estimated from the
    /// data, or if the differentiator has no cut-off.
    pub fn cutoff_hz(&self) -> Option<f64> {
        self.clone().cutoff_place().copied().flatten()
    }

    /// Whether the cut-off is estimated from the data.
    pub fn wants_cutoff(&self) -> bool {
        matches!(self.clone().cutoff_place(), Some(None))
    }

    /// Sets the cut-off if the settings leave it to the data.
    #[must_use]
    pub fn with_cutoff(mut self, chosen_cutoff_hz: f64) -> Self {
        if let Some(place) = self.cutoff_place() {
            place.get_or_insert(chosen_cutoff_hz);
        }
        self
    }

    /// Creates the differentiator; `chosen_cutoff_hz` is used if the settings contain no cut-off. If the settings
    /// contain a commanded motion, it must be in closed form; for a table, use
    /// [`build_following`](Self::build_following).
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn build(&self, chosen_cutoff_hz: f64) -> Result<Box<dyn Differentiator>, FilterError> {
        self.build_following(chosen_cutoff_hz, None)
    }

    /// As [`build`](Self::build), with a commanded motion that is used instead of that in the settings.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting; [`FilterError::NoReference`] if this differentiator needs a commanded
    /// motion and has none.
    pub fn build_following(
        &self,
        chosen_cutoff_hz: f64,
        given: Option<&Arc<Reference>>,
    ) -> Result<Box<dyn Differentiator>, FilterError> {
        let motion = |settings: &ReferenceSettings, method| match given {
            Some(given) => Ok(Arc::clone(given)),
            None => settings.closed_form()?.map(Arc::new).ok_or(FilterError::NoReference { method }),
        };
        let cutoff_hz = self.cutoff_hz().unwrap_or(chosen_cutoff_hz);
        Ok(match self {
            Self::Butterworth { order, .. } => Box::new(ButterworthZeroPhase::new(*order, cutoff_hz)?),
            Self::CentralDifferences { order } => Box::new(CentralDifferences::new(*order)?),
            Self::SavitzkyGolay { window, degree } => Box::new(SavitzkyGolay::new(*window, *degree)?),
            Self::LowPass { order, .. } => Box::new(LowPass::new(*order, cutoff_hz)?),
            Self::FourierFit { base_hz, harmonics, trend } => Box::new(FourierFit::new(*base_hz, *harmonics, *trend)?),
            Self::FrequencyDomain { ends, .. } => Box::new(FrequencyDomain::new(cutoff_hz, *ends)?),
            Self::SmoothedDifferences { order, window } => Box::new(SmoothedDifferences::new(*order, *window)?),
            Self::FivePointCubic { passes, .. } => Box::new(FivePointCubic::new(*passes, cutoff_hz)?),
            Self::VelocitySeries { base_hz, harmonics, .. } => {
                Box::new(VelocitySeries::new(*base_hz, *harmonics, cutoff_hz)?)
            }
            Self::PositionMap { reference, max_lag_s } => {
                Box::new(PositionMap::new(motion(reference, "position-map")?, *max_lag_s)?)
            }
            Self::TimeWarp { reference, max_lag_s } => {
                Box::new(TimeWarp::new(motion(reference, "time-warp")?, *max_lag_s)?)
            }
            Self::Function { function, code } => match code.build() {
                Some(own) => own,
                None => return Err(FilterError::NoFunction { name: function.clone() }),
            },
            Self::Deviation { reference, smoother, max_lag_s } => {
                self.validate()?;
                let reference = motion(reference, "deviation")?;
                Box::new(Deviation::new(reference, smoother.build(chosen_cutoff_hz)?, *max_lag_s)?)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_json() {
        for text in [
            "method = \"time-warp\"\nreference = \"a.csv\"",
            "method = \"logistic-map\"\nreference = { start_s = -1.5, joints = [{ amplitude = 1.0, omega = 1.0, offset = 0.0, period_s = 40.0 }] }",
            "method = \"deviation\"\nmax_lag_s = 0.1\nreference = { file = \"a.csv\", start_s = 2.0, strokes_s = [0.0, 1.5] }\nsmoother = { method = \"savitzky-golay\", window = 21 }",
            "method = \"frequency-domain\"\nends = \"periodic\"",
        ] {
            let settings: DifferentiatorSettings = toml::from_str(text).unwrap();
            settings.validate().unwrap();
            let json = serde_json::to_string(&settings).unwrap();
            assert_eq!(serde_json::from_str::<DifferentiatorSettings>(&json).unwrap(), settings, "{json}");
        }
    }

    #[test]
    fn contradictions_and_misspelt_keys_are_refused() {
        for text in [
            "method = \"time-warp\"\nreference = { fle = \"a.csv\" }",
            "method = \"time-warp\"\nrefrence = \"a.csv\"",
            "method = \"time-warp\"\nreference = 3",
        ] {
            assert!(toml::from_str::<DifferentiatorSettings>(text).is_err(), "{text}");
        }
        for text in [
            "method = \"time-warp\"\nmax_lag_s = 0.0",
            "method = \"time-warp\"\nreference = { start_s = inf }",
            "method = \"time-warp\"\nreference = { strokes_s = [1.0] }",
            "method = \"time-warp\"\nreference = { strokes_s = [1.0, 0.5] }",
            "method = \"time-warp\"\nreference = { file = \"a.csv\", joints = [{ amplitude = 1.0, omega = 1.0, offset = 0.0, period_s = 40.0 }] }",
            "method = \"deviation\"\nsmoother = { method = \"time-warp\" }",
        ] {
            let settings: DifferentiatorSettings = toml::from_str(text).unwrap();
            assert!(settings.validate().is_err(), "{text}");
        }
    }

    #[test]
    fn an_estimated_cutoff_is_filled_in_also_in_the_smoother() {
        let settings: DifferentiatorSettings = toml::from_str("method = \"deviation\"").unwrap();
        assert!(settings.wants_cutoff());
        let settings = settings.with_cutoff(3.0).with_cutoff(5.0);
        assert_eq!((settings.wants_cutoff(), settings.cutoff_hz()), (false, Some(3.0)));
        let none: DifferentiatorSettings = toml::from_str("method = \"savitzky-golay\"\nwindow = 5").unwrap();
        assert_eq!((none.wants_cutoff(), none.with_cutoff(3.0).cutoff_hz()), (false, None));
    }
}
