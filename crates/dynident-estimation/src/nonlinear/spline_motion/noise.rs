//! Noise of positions and torques of a log, and smoothness of its motion.

use super::smoothing::Smoothness;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogNoise {
    /// Noise and smoothness of the positions, by joint.
    pub(super) positions: Vec<Smoothness>,
    /// σ of the innovation of a row's torque by joint, N m (N).
    pub(super) torque_std: Vec<f64>,
    /// Total variance of a row's torque noise by joint.
    pub(super) torque_variance: Vec<f64>,
    /// Autoregression of the torque noise from row to row, by joint.
    pub(super) colours: Vec<Vec<f64>>,
}

impl LogNoise {
    pub(super) fn most_order(&self) -> usize {
        self.colours.iter().map(Vec::len).max().unwrap_or(0)
    }

    /// Largest change of any noise level, as a logarithm.
    pub(super) fn change(&self, other: &Self) -> f64 {
        let positions = self.positions.iter().zip(&other.positions);
        let positions = positions.map(|(a, b)| (a.position_std / b.position_std).ln().abs());
        let torques = self.torque_std.iter().zip(&other.torque_std).map(|(a, b)| (a / b).ln().abs());
        positions.chain(torques).fold(0.0, f64::max)
    }
}
