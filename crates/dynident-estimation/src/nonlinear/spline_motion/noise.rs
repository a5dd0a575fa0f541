//! How noisy positions and torques of a log are, and how smooth its motion: what the likelihood finds beside motion and
//! parameters.

use super::smoothing::Smoothness;

/// Of one log.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogNoise {
    /// Joint by joint.
    pub(super) positions: Vec<Smoothness>,
    /// σ of what is new in a row's torque, joint by joint, N m (N).
    pub(super) torque_std: Vec<f64>,
    /// Variance of a row's torque noise, old and new together, joint by joint.
    pub(super) torque_variance: Vec<f64>,
    /// Autoregression of the torque's noise from row to row, joint by joint.
    pub(super) colours: Vec<Vec<f64>>,
}

impl LogNoise {
    /// The longest autoregression.
    pub(super) fn most_order(&self) -> usize {
        self.colours.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// The largest change of any level, as a logarithm.
    pub(super) fn change(&self, other: &Self) -> f64 {
        let positions = self.positions.iter().zip(&other.positions);
        let positions = positions.map(|(a, b)| (a.position_std / b.position_std).ln().abs());
        let torques = self.torque_std.iter().zip(&other.torque_std).map(|(a, b)| (a / b).ln().abs());
        positions.chain(torques).fold(0.0, f64::max)
    }
}
