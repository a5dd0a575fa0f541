//! Predicted error bars of the parameters for a planned motion.

use nalgebra::{DMatrix, SymmetricEigen};

/// Predicted errors of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedCovariance {
    /// Standard deviation of every parameter's estimate, `√(D⁻¹)_kk`; `None` for a parameter that the motion does not
    /// determine.
    pub std: Vec<Option<f64>>,
    /// Directions in the parameter space with the largest uncertainty, the largest first.
    pub worst: Vec<Direction>,
}

/// A combination of parameters. The unit of each parameter is the standard deviation that it would have as the only
/// unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// Factor by which the unknown other parameters increase the standard deviation of this direction.
    pub inflation: f64,
    /// Components of the direction, a unit vector.
    pub shares: Vec<f64>,
}

/// Predicts the covariance of weighted least squares from the information `D = Σ_j W_jᵀ W_j / σ_j²` of a motion (W_j:
/// regressor of joint j, σ_j: standard deviation of its torque). The covariance is `D⁻¹` if the torque errors are
/// independent with the assumed σ_j (Swevers et al., IEEE Trans. Robotics and Automation 13(5), 1997). Residuals that
/// are correlated in time increase the error bars, by factors of 1.3 to 9 on known arms.
///
/// The reported directions are the `directions` eigenvectors with the smallest eigenvalues of `D`, scaled to a unit
/// diagonal.
pub fn predicted_covariance(information: &DMatrix<f64>, directions: usize) -> PredictedCovariance {
    let count = information.nrows();
    let scale: Vec<f64> =
        information.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt().recip() } else { 0.0 }).collect();
    let scaled = DMatrix::from_fn(count, count, |i, j| scale[i] * information[(i, j)] * scale[j]);
    let eigen = SymmetricEigen::new(scaled);
    // Smaller eigenvalues are rounding errors of the sum over all samples: such a direction is not excited.
    let least = f64::EPSILON * count as f64 * eigen.eigenvalues.max();
    let std = |index: usize| -> Option<f64> {
        let mut variance = 0.0;
        for (direction, &value) in eigen.eigenvalues.iter().enumerate() {
            let share = eigen.eigenvectors[(index, direction)].powi(2);
            if value > least {
                variance += share / value;
            } else if share > f64::EPSILON.sqrt() {
                return None;
            }
        }
        Some(variance.sqrt() * scale[index]).filter(|std| std.is_finite() && *std > 0.0)
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let direction = |&k: &usize| Direction {
        inflation: eigen.eigenvalues[k].max(least).sqrt().recip(),
        shares: eigen.eigenvectors.column(k).iter().copied().collect(),
    };
    PredictedCovariance {
        std: (0..count).map(std).collect(),
        worst: order.iter().take(directions).map(direction).collect(),
    }
}
