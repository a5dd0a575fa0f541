//! Reported effect of noise in the regressor on least squares.

use dynident_estimation::{FastMotion, HausmanTest, InstrumentReport};
use serde::{Deserialize, Serialize};

/// Effect of noise in the regressor on least squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum NoiseVerdict {
    /// Not significant: torque also follows the fast motion, or the estimates agree within their error bars.
    Harmless,
    /// Bias of least squares that exceeds the error bars.
    BiasesLeastSquares,
    /// Not determined, or not tested.
    #[default]
    Undecided,
}

/// Difference of two estimates of the same parameters, in error bars (standard deviations) of the second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EstimateContrast {
    /// Root mean square over the parameters.
    pub rms: f64,
    /// Largest difference.
    pub largest: f64,
    /// Parameter with the largest difference.
    pub column: String,
}

/// Results of the test for noise in the regressor.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NoiseInRegressor {
    /// Lowest and highest cut-off of the instruments over the logs, Hz; `None` for instruments without a filter.
    pub instrument_cutoff_hz: Option<[f64; 2]>,
    /// Strength of the instruments.
    pub instruments: InstrumentReport,
    /// Hausman test of least squares against instruments.
    pub hausman: HausmanTest,
    /// Effect on least squares.
    #[serde(default)]
    pub verdict: NoiseVerdict,
    /// Whether torque follows the fast part of the motion, which instruments with half the regressor's cut-off do not
    /// contain; `None` if not determined.
    #[serde(default)]
    pub fast_motion: Option<FastMotion>,
    /// Difference of least squares and instruments; `None` for external instruments.
    #[serde(default)]
    pub least_squares: Option<EstimateContrast>,
    /// Whether `method = "auto"` selected the instruments' estimate.
    #[serde(default)]
    pub instruments_taken: bool,
    /// Automatic cut-off of the regressor before it was lowered because of noise, Hz.
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
