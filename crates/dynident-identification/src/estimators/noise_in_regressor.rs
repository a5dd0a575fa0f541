//! Report on the effect of noise in the regressor on least squares.

use dynident_estimation::{FastMotion, HausmanTest, InstrumentReport};
use serde::{Deserialize, Serialize};

/// Effect of noise in the regressor on least squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum NoiseVerdict {
    /// Not significant: the torque also follows the fast motion, or the estimates with and without instruments agree
    /// within their error bars.
    Harmless,
    /// Least squares is biased by more than its error bars.
    BiasesLeastSquares,
    /// Not determined, or not tested.
    #[default]
    Undecided,
}

/// Difference of two estimates of the same parameters, in standard deviations of the second estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EstimateContrast {
    /// Root mean square over the parameters.
    pub rms: f64,
    /// Largest difference.
    pub largest: f64,
    /// Symbol of the parameter with the largest difference.
    pub column: String,
}

/// Results of the test whether noise in the regressor biases least squares.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NoiseInRegressor {
    /// Lowest and highest cut-off of the instruments over the logs, Hz; `None` for instruments without a filter.
    pub instrument_cutoff_hz: Option<[f64; 2]>,
    /// Strength of the instruments.
    pub instruments: InstrumentReport,
    /// Hausman test that compares least squares with instrumental variables.
    pub hausman: HausmanTest,
    /// Verdict about the effect on least squares.
    #[serde(default)]
    pub verdict: NoiseVerdict,
    /// Whether the torque follows the fast part of the motion, which instruments with half the regressor's cut-off do
    /// not contain; `None` if not determined.
    #[serde(default)]
    pub fast_motion: Option<FastMotion>,
    /// Difference between the estimates of least squares and of instrumental variables; `None` for external
    /// instruments.
    #[serde(default)]
    pub least_squares: Option<EstimateContrast>,
    /// Whether `method = "auto"` selected the estimate of instrumental variables.
    #[serde(default)]
    pub instruments_taken: bool,
    /// Automatic cut-off of the regressor before it was lowered because of noise, Hz; null if it was not lowered.
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
