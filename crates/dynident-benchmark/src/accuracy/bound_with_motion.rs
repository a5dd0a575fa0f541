//! Cramér-Rao bound for estimators with unknown motion.

use super::noise::NoiseLevel;
use super::scenario::{RATE_HZ, SERIES, Scenario};
use dynident_estimation::{ChannelNoise, ChannelRows, EstimationError, SimultaneousModel, simultaneous_bound};
use dynident_identification::estimators::{PeriodicModel, PeriodicRecord};

/// Rows of positions and torques at the true parameters, by sample.
pub(super) struct BoundWithMotion<'a> {
    names: &'a [String],
    motion: usize,
    joints: usize,
    rows: Vec<ChannelRows>,
}

impl<'a> BoundWithMotion<'a> {
    pub(super) fn new(scenario: &Scenario, names: &'a [String]) -> Result<Self, EstimationError> {
        let record = PeriodicRecord { rate_hz: RATE_HZ, q: scenario.motion.q.clone(), tau: scenario.torque.clone() };
        let mut model = PeriodicModel::new(&scenario.model, &record, SERIES, 1);
        let motion = model.fitted_motion().ok_or(EstimationError::Empty)?;
        let rows = model.linearised(&motion, &scenario.truth)?;
        Ok(Self { names, motion: motion.len(), joints: scenario.model.dof(), rows })
    }

    /// Bound of every base parameter's standard deviation, if the motion is a Fourier series with the excitation's
    /// frequencies and unknown coefficients.
    pub(super) fn of(&self, level: &NoiseLevel) -> Result<Vec<f64>, EstimationError> {
        let rho = level.torque_correlation;
        let position = ChannelNoise { std: level.position_std_rad(), autoregression: Vec::new() };
        let torque = ChannelNoise {
            std: level.torque_std_nm * (1.0 - rho * rho).sqrt(),
            autoregression: if rho == 0.0 { Vec::new() } else { vec![rho] },
        };
        let mut noise = vec![position; self.joints];
        noise.extend(vec![torque; self.joints]);
        let covariance = simultaneous_bound(self.names, self.motion, &self.rows, &noise)?;
        Ok(covariance.diagonal().iter().map(|variance: &f64| variance.sqrt()).collect())
    }
}
