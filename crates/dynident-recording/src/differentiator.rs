//! From q to dq and ddq: the interface, and the registry of every way that is offered.

use crate::butterworth::ButterworthZeroPhase;
use crate::central_differences::CentralDifferences;
use crate::error::FilterError;
use crate::savitzky_golay::SavitzkyGolay;
use serde::{Deserialize, Serialize};

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

/// One way from uniformly sampled positions of one joint to filtered position, velocity and acceleration.
///
/// Implementations are linear and shift-invariant away from the ends of the signal, so that a long log can be worked
/// through in pieces: a window with [`context_samples`](Self::context_samples) more on either side gives inside what the
/// whole log would give.
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
    /// Checks what can be checked without a log.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        self.build(1.0).map(|_| ())
    }

    /// Whether the cut-off is left to the data.
    pub fn wants_cutoff(&self) -> bool {
        matches!(self, Self::Butterworth { cutoff_hz: None, .. })
    }

    /// The differentiator; `chosen_cutoff_hz` stands in where the settings name none.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn build(&self, chosen_cutoff_hz: f64) -> Result<Box<dyn Differentiator>, FilterError> {
        Ok(match *self {
            Self::Butterworth { order, cutoff_hz } => {
                Box::new(ButterworthZeroPhase::new(order, cutoff_hz.unwrap_or(chosen_cutoff_hz))?)
            }
            Self::CentralDifferences { order } => Box::new(CentralDifferences::new(order)?),
            Self::SavitzkyGolay { window, degree } => Box::new(SavitzkyGolay::new(window, degree)?),
        })
    }
}
