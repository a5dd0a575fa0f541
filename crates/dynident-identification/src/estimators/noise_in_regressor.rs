//! The effect of noise in the regressor on least squares, as it is reported.

use dynident_estimation::{FastMotion, HausmanTest, InstrumentReport};
use serde::{Deserialize, Serialize};

/// The effect of noise in the regressor on least squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum NoiseVerdict {
    /// Nothing that matters: torque follows the fast motion too, or the estimates agree within their error bars.
    Harmless,
    /// It biases least squares by more than the error bars say.
    BiasesLeastSquares,
    /// Not determined, or not tested.
    #[default]
    Undecided,
}

/// By how much two estimates of the same parameters differ, in error bars (standard deviations) of the second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EstimateContrast {
    /// Root mean square over the parameters.
    pub rms: f64,
    /// The largest.
    pub largest: f64,
    /// The parameter with the largest.
    pub column: String,
}

/// Results of the test for noise in the regressor.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NoiseInRegressor {
    /// Lowest and highest cut-off of the instruments over the logs, Hz; none when they do not come from a filter.
    pub instrument_cutoff_hz: Option<[f64; 2]>,
    /// How well the instruments explain the regressor.
    pub instruments: InstrumentReport,
    /// Least squares against instruments: was filtering enough?
    pub hausman: HausmanTest,
    /// The consequence for least squares.
    #[serde(default)]
    pub verdict: NoiseVerdict,
    /// Whether torque follows the fast part of the motion, which instruments of half the regressor's cut-off leave
    /// over; none where there is nothing to tell it by.
    #[serde(default)]
    pub fast_motion: Option<FastMotion>,
    /// Least squares against instruments; none where the instruments come from elsewhere.
    #[serde(default)]
    pub least_squares: Option<EstimateContrast>,
    /// Whether `method = "auto"` took the instruments' estimate.
    #[serde(default)]
    pub instruments_taken: bool,
    /// The cut-off of the regressor that was chosen from the logs, where a lower one was taken because of noise, Hz.
    #[serde(default)]
    pub cutoff_before_hz: Option<f64>,
}

impl NoiseInRegressor {
    pub(super) fn of_test(instruments: InstrumentReport, hausman: HausmanTest) -> Self {
        Self {
            instrument_cutoff_hz: None,
            instruments,
            hausman,
            verdict: NoiseVerdict::Undecided,
            fast_motion: None,
            least_squares: None,
            instruments_taken: false,
            cutoff_before_hz: None,
        }
    }
}
