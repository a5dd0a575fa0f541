//! From q to dq and ddq: the interface, and the registry of every way that is offered.

use crate::butterworth::ButterworthZeroPhase;
use crate::central_differences::CentralDifferences;
use crate::deviation::Deviation;
use crate::error::FilterError;
use crate::five_point_cubic::FivePointCubic;
use crate::fourier_fit::FourierFit;
use crate::frequency_domain::{Ends, FrequencyDomain};
use crate::literal_map::LiteralMap;
use crate::low_pass::LowPass;
use crate::position_map::PositionMap;
use crate::reference::Reference;
use crate::reference_lag::check_max_lag;
use crate::reference_settings::ReferenceSettings;
use crate::savitzky_golay::SavitzkyGolay;
use crate::smoothed_differences::SmoothedDifferences;
use crate::speed_series::SpeedSeries;
use crate::time_warp::TimeWarp;
use core::ops::Range;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Where a differentiator writes: three slices of the input's length.
#[derive(Debug)]
pub struct Derivatives<'a> {
    /// Filtered position.
    pub q: &'a mut [f64],
    /// First derivative, per second.
    pub dq: &'a mut [f64],
    /// Second derivative, per second squared.
    pub ddq: &'a mut [f64],
}

/// Which samples are looked at: ways that know the commanded motion need the joint and the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Samples per second.
    pub rate_hz: f64,
    /// The joint, in the order of the reference.
    pub joint: usize,
    /// Time of the first sample, seconds after the log's first row.
    pub first_time_s: f64,
}

impl Place {
    /// Time of sample `i`.
    pub fn time_s(&self, i: usize) -> f64 {
        self.first_time_s + i as f64 / self.rate_hz
    }
}

/// Appends sample `i` to ascending ranges.
pub(crate) fn add_sample(ranges: &mut Vec<Range<usize>>, i: usize) {
    match ranges.last_mut() {
        Some(last) if last.end >= i => last.end = last.end.max(i + 1),
        _ => ranges.push(i..i + 1),
    }
}

/// One way from uniformly sampled positions of one joint to filtered position, velocity and acceleration.
///
/// A way that tells its [`context_samples`](Self::context_samples) works through a long log in pieces: a window with so many samples more on either side gives inside what the
/// whole log would give. Ways that fit something to the whole piece, or estimate a lag over it, tell none.
pub trait Differentiator: core::fmt::Debug + Send + Sync {
    /// Name as in the study file.
    fn name(&self) -> &'static str;

    /// Samples on either side of a piece within which the ends of the window are felt (to 1e-12 of the signal);
    /// `None` if every sample depends on the whole log.
    fn context_samples(&self, rate_hz: f64) -> Option<usize>;

    /// Shortest signal that it can be applied to.
    fn minimum_samples(&self) -> usize;

    /// Fills `out` from the positions `q`, sampled at `rate_hz`.
    ///
    /// # Errors
    /// [`FilterError`] if `q` is shorter than [`minimum_samples`](Self::minimum_samples) or the filter does not exist at
    /// this rate.
    ///
    /// # Panics
    /// If a slice of `out` is shorter than `q`.
    fn differentiate(&self, rate_hz: f64, q: &[f64], out: Derivatives<'_>) -> Result<(), FilterError>;

    /// As [`differentiate`](Self::differentiate), told which joint it is and when; ways that follow a [`Reference`] need that, all others ignore it. Without it they take the samples for those of the first joint
    /// from time zero on.
    ///
    /// Returns the samples at which this way does not apply, as ascending ranges: speed and acceleration there mean nothing.
    ///
    /// # Errors
    /// As [`differentiate`](Self::differentiate).
    fn differentiate_at(
        &self,
        place: Place,
        q: &[f64],
        out: Derivatives<'_>,
    ) -> Result<Vec<Range<usize>>, FilterError> {
        self.differentiate(place.rate_hz, q, out).map(|()| Vec::new())
    }

    /// Applies only the smoothing to another signal of the same clock (a torque), as it is applied to q.
    ///
    /// # Errors
    /// As [`differentiate`](Self::differentiate).
    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError>;
}

/// The registry: what a study file may ask for under `differentiator`.
///
/// ```
/// use dynident_recording::DifferentiatorSettings;
/// let settings: DifferentiatorSettings = toml::from_str("method = \"butterworth\"\ncutoff_hz = 8.0").unwrap();
/// assert_eq!(settings, DifferentiatorSettings::Butterworth { order: 4, cutoff_hz: Some(8.0) });
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "kebab-case", deny_unknown_fields)]
pub enum DifferentiatorSettings {
    /// [`ButterworthZeroPhase`]; without `cutoff_hz` the cut-off is chosen from the data ([`cutoff`](crate::cutoff())).
    Butterworth {
        /// Order of the one-way filter, 1 to 12; 4 by default.
        #[serde(default = "four")]
        order: usize,
        /// Cut-off; chosen from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`CentralDifferences`] of the positions as logged.
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
    /// [`LowPass`]: a causal Butterworth filter, which makes everything late.
    LowPass {
        /// Order, 1 to 12; 4 by default.
        #[serde(default = "four")]
        order: usize,
        /// Cut-off; chosen from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`FourierFit`]: a series fitted to the positions of the whole piece.
    FourierFit {
        /// Base frequency of the motion.
        base_hz: f64,
        /// Highest harmonic, 1 to 200.
        harmonics: usize,
        /// Whether a straight line is fitted beside them; true by default.
        #[serde(default = "yes")]
        trend: bool,
    },
    /// [`FrequencyDomain`]: jω up to a cut-off, nothing beyond.
    FrequencyDomain {
        /// Highest frequency that is kept; chosen from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
        /// What stands beyond the ends; a smooth bridge by default.
        #[serde(default)]
        ends: Ends,
    },
    /// [`SmoothedDifferences`]: central differences, acceleration and torque by a moving average.
    SmoothedDifferences {
        /// Order of accuracy of the differences; 2 by default.
        #[serde(default = "two")]
        order: usize,
        /// Odd number of samples, 3 to 501.
        window: usize,
    },
    /// [`FivePointCubic`]: torque by five-point cubic smoothing, low-pass filtered differences of position.
    FivePointCubic {
        /// Passes over the torque; 1 by default.
        #[serde(default = "one")]
        passes: usize,
        /// Cut-off of the low-pass; chosen from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`SpeedSeries`]: a Fourier series fitted to the filtered speed.
    SpeedSeries {
        /// Base frequency of the motion.
        base_hz: f64,
        /// Highest harmonic, 1 to 200.
        harmonics: usize,
        /// Cut-off of the filter; chosen from the data by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        cutoff_hz: Option<f64>,
    },
    /// [`PositionMap`]: the paper's map, position to speed and acceleration on a known stroke.
    #[serde(alias = "logistic-map")]
    PositionMap {
        /// The commanded motion; a log may have its own.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Longest lag of a joint behind it that is looked for, s; 0.5 by default.
        #[serde(default = "half")]
        max_lag_s: f64,
    },
    /// [`LiteralMap`]: the paper's map to the letter, right or wrong: to show what it does.
    LiteralMap {
        /// The commanded strokes in closed form.
        #[serde(default)]
        reference: ReferenceSettings,
    },
    /// [`TimeWarp`]: the reference at a shifted time, one lag a stroke.
    TimeWarp {
        /// The commanded motion; a log may have its own.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Longest lag of a joint behind it that is looked for, s; 0.5 by default.
        #[serde(default = "half")]
        max_lag_s: f64,
    },
    /// [`Deviation`]: the reference's own derivatives, and those of the smoothed deviation from it.
    Deviation {
        /// The commanded motion; a log may have its own.
        #[serde(default)]
        reference: ReferenceSettings,
        /// Any of the ways that need no reference; zero-phase Butterworth by default.
        #[serde(default)]
        smoother: Box<DifferentiatorSettings>,
        /// Shift the reference by the joint's lag behind it, at most so many seconds; not shifted by default.
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
    /// Checks what can be checked without a log and without the reference's table.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        match self {
            Self::PositionMap { reference, max_lag_s } | Self::TimeWarp { reference, max_lag_s } => {
                reference.validate()?;
                check_max_lag(*max_lag_s)
            }
            Self::LiteralMap { reference } => reference.validate(),
            Self::Deviation { reference, smoother, max_lag_s } => {
                reference.validate()?;
                max_lag_s.map_or(Ok(()), check_max_lag)?;
                if smoother.reference().is_some() {
                    let problem = "the smoother of a deviation must not need a reference itself".to_owned();
                    return Err(FilterError::Reference { problem });
                }
                smoother.validate()
            }
            _ => self.build(1.0).map(|_| ()),
        }
    }

    /// How the commanded motion is named; `None` for ways that need none.
    pub fn reference(&self) -> Option<&ReferenceSettings> {
        match self {
            Self::PositionMap { reference, .. }
            | Self::LiteralMap { reference }
            | Self::TimeWarp { reference, .. }
            | Self::Deviation { reference, .. } => Some(reference),
            _ => None,
        }
    }

    fn cutoff_place(&mut self) -> Option<&mut Option<f64>> {
        match self {
            Self::Butterworth { cutoff_hz, .. }
            | Self::LowPass { cutoff_hz, .. }
            | Self::FrequencyDomain { cutoff_hz, .. }
            | Self::FivePointCubic { cutoff_hz, .. }
            | Self::SpeedSeries { cutoff_hz, .. } => Some(cutoff_hz),
            Self::Deviation { smoother, .. } => smoother.cutoff_place(),
            _ => None,
        }
    }

    /// The cut-off that the settings name (a deviation's smoother names its own); `None` where there is none, or it is left to the data.
    pub fn cutoff_hz(&self) -> Option<f64> {
        self.clone().cutoff_place().copied().flatten()
    }

    /// Whether the cut-off is left to the data.
    pub fn wants_cutoff(&self) -> bool {
        matches!(self.clone().cutoff_place(), Some(None))
    }

    /// The same with this cut-off, where it was left to the data.
    #[must_use]
    pub fn with_cutoff(mut self, chosen_cutoff_hz: f64) -> Self {
        if let Some(place) = self.cutoff_place() {
            place.get_or_insert(chosen_cutoff_hz);
        }
        self
    }

    /// The differentiator; `chosen_cutoff_hz` stands in where the settings name none. A commanded motion has to be given in closed form: see [`build_following`](Self::build_following).
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn build(&self, chosen_cutoff_hz: f64) -> Result<Box<dyn Differentiator>, FilterError> {
        self.build_following(chosen_cutoff_hz, None)
    }

    /// As [`build`](Self::build), with the commanded motion, which stands before what the settings name.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting; [`FilterError::NoReference`] if this way needs a motion and has none.
    pub fn build_following(
        &self,
        chosen_cutoff_hz: f64,
        given: Option<&Arc<Reference>>,
    ) -> Result<Box<dyn Differentiator>, FilterError> {
        let motion = |settings: &ReferenceSettings, method| match given {
            Some(given) => Ok(Arc::clone(given)),
            None => settings.closed_form()?.map(Arc::new).ok_or(FilterError::NoReference { method }),
        };
        Ok(match self {
            Self::Butterworth { order, cutoff_hz } => {
                Box::new(ButterworthZeroPhase::new(*order, cutoff_hz.unwrap_or(chosen_cutoff_hz))?)
            }
            Self::CentralDifferences { order } => Box::new(CentralDifferences::new(*order)?),
            Self::SavitzkyGolay { window, degree } => Box::new(SavitzkyGolay::new(*window, *degree)?),
            Self::LowPass { order, cutoff_hz } => {
                Box::new(LowPass::new(*order, cutoff_hz.unwrap_or(chosen_cutoff_hz))?)
            }
            Self::FourierFit { base_hz, harmonics, trend } => Box::new(FourierFit::new(*base_hz, *harmonics, *trend)?),
            Self::FrequencyDomain { cutoff_hz, ends } => {
                Box::new(FrequencyDomain::new(cutoff_hz.unwrap_or(chosen_cutoff_hz), *ends)?)
            }
            Self::SmoothedDifferences { order, window } => Box::new(SmoothedDifferences::new(*order, *window)?),
            Self::FivePointCubic { passes, cutoff_hz } => {
                Box::new(FivePointCubic::new(*passes, cutoff_hz.unwrap_or(chosen_cutoff_hz))?)
            }
            Self::SpeedSeries { base_hz, harmonics, cutoff_hz } => {
                Box::new(SpeedSeries::new(*base_hz, *harmonics, cutoff_hz.unwrap_or(chosen_cutoff_hz))?)
            }
            Self::PositionMap { reference, max_lag_s } => {
                Box::new(PositionMap::new(motion(reference, "position-map")?, *max_lag_s)?)
            }
            Self::LiteralMap { reference } => Box::new(LiteralMap::new(motion(reference, "literal-map")?)),
            Self::TimeWarp { reference, max_lag_s } => {
                Box::new(TimeWarp::new(motion(reference, "time-warp")?, *max_lag_s)?)
            }
            Self::Deviation { reference, smoother, max_lag_s } => {
                self.validate()?;
                let reference = motion(reference, "deviation")?;
                Box::new(Deviation::new(reference, smoother.build(chosen_cutoff_hz)?, *max_lag_s)?)
            }
        })
    }
}
