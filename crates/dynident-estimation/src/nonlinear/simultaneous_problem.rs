//! A fit of motion and parameters together: model, problem, settings and result.

use super::simultaneous_rows::ChannelRows;
use crate::error::{EstimationError, require, within};
use crate::factor::RankSettings;
use crate::uncertainty::{CovarianceMethod, Estimate};
use serde::{Deserialize, Serialize};

/// Model of [`simultaneous_least_squares`](crate::simultaneous_least_squares): measurements minus predictions from
/// motion and parameters.
pub trait SimultaneousModel {
    /// Error of the model.
    type Error: From<EstimationError>;

    /// Residuals `y − f` (measurement minus prediction) by channel, always with the same number of rows.
    ///
    /// # Errors
    /// Defined by the model.
    fn residuals(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<Vec<f64>>, Self::Error>;

    /// Residuals with derivatives. The derivatives may be approximate: they affect the speed of convergence and the
    /// weights, but do not bias the result.
    ///
    /// # Errors
    /// Defined by the model.
    fn linearised(&mut self, motion: &[f64], parameters: &[f64]) -> Result<Vec<ChannelRows>, Self::Error>;
}

/// Noise of a channel: `e_t = a_1 e_{t−1} + … + a_k e_{t−k} + white noise of standard deviation std`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelNoise {
    /// Standard deviation of the innovation per row, in the channel's unit.
    pub std: f64,
    /// a_1 to a_k; empty for white noise.
    pub autoregression: Vec<f64>,
}

/// Names and start values of the unknowns.
#[derive(Clone, Debug, PartialEq)]
pub struct SimultaneousProblem {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Names of the measured channels, in the model's order.
    pub channels: Vec<String>,
    /// Start values of the motion's unknowns, for example Fourier coefficients fitted to the positions.
    pub motion: Vec<f64>,
    /// Start values of the parameters, for example a least-squares estimate.
    pub parameters: Vec<f64>,
}

/// Settings of [`simultaneous_least_squares`](crate::simultaneous_least_squares).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SimultaneousSettings {
    /// Criteria for an excited column after the motion is eliminated.
    pub rank: RankSettings,
    /// Method of the reported covariance of whitened rows; from time segments by default. The white-noise covariance
    /// is correct if the noise is autoregressive and the model complete.
    pub covariance: CovarianceMethod,
    /// Maximum order of the autoregression of a channel's residuals; Schwarz's criterion (BIC) selects the order.
    /// Default 4; 0 assumes white noise.
    pub most_autoregression: usize,
    /// The iteration ends at this step length, in error bars over all directions. Default 1e-3.
    pub tolerance: f64,
    /// Maximum number of steps. Default 30; three to six are usual.
    pub max_iterations: usize,
}

impl Default for SimultaneousSettings {
    fn default() -> Self {
        Self {
            rank: RankSettings::default(),
            covariance: CovarianceMethod::default(),
            most_autoregression: 4,
            tolerance: 1.0e-3,
            max_iterations: 30,
        }
    }
}

impl SimultaneousSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`EstimationError::Setting`] for an order above 64, a tolerance outside 1e-9 to 1, fewer than two iterations, or
    /// rank settings out of range.
    pub fn validate(&self) -> Result<(), EstimationError> {
        self.rank.validate()?;
        let fix = "use 0 to 64";
        require(self.most_autoregression <= 64, "most_autoregression", self.most_autoregression as f64, fix)?;
        within("tolerance", self.tolerance, 1.0e-9..=1.0, "use a length in error bars from 1e-9 to 1")?;
        require(self.max_iterations >= 2, "max_iterations", self.max_iterations as f64, "use at least 2")
    }
}

/// Result of [`simultaneous_least_squares`](crate::simultaneous_least_squares).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimultaneousEstimate {
    /// The parameters. The "joints" of this estimate are the channels, with σ of whitened rows.
    pub estimate: Estimate,
    /// Estimated unknowns of the motion.
    pub motion: Vec<f64>,
    /// Estimated noise of the channels.
    pub noise: Vec<ChannelNoise>,
}
