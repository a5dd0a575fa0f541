//! Condition number of the stacked regressor, `√(λ_max / λ_min)` of its information matrix.

use super::{Criterion, ValueAndGradient};
use crate::symmetric_eigen::SymmetricEigen;
use nalgebra::DMatrix;

/// Condition number of the regressor W by p-norms of the eigenvalues λ of its information matrix: `½ (log ‖λ‖_p + log
/// ‖1/λ‖_p)`. It is smooth where eigenvalues coincide, which the lowest three or four do at an optimum. A larger `p`
/// approximates the condition number more closely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConditionNumber {
    /// Order of the norm, positive; 40 to 80 is suitable from the start of a search.
    pub order: f64,
    /// Whether each column is first divided by its norm, so that the condition number does not depend on units.
    pub scaled: bool,
}

impl Default for ConditionNumber {
    fn default() -> Self {
        Self { order: 40.0, scaled: false }
    }
}

impl ConditionNumber {
    /// `S D S` with `S = diag(D)^-1/2`, or `D` if not scaled; also the scale S.
    fn scaling(&self, information: &DMatrix<f64>) -> Option<(DMatrix<f64>, Vec<f64>)> {
        if !self.scaled {
            return Some((information.clone(), vec![1.0; information.nrows()]));
        }
        let scale: Vec<f64> = information.diagonal().iter().map(|d| d.sqrt().recip()).collect();
        if scale.iter().any(|s| !s.is_finite()) {
            return None;
        }
        let scaled = DMatrix::from_fn(information.nrows(), information.ncols(), |i, j| {
            scale[i] * information[(i, j)] * scale[j]
        });
        Some((scaled, scale))
    }
}

impl Criterion for ConditionNumber {
    fn name(&self) -> &'static str {
        if self.scaled { "condition-number-scaled" } else { "condition-number" }
    }

    fn has_many_optima(&self) -> bool {
        true
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        let (matrix, scale) = self.scaling(information)?;
        let eigen = SymmetricEigen::new(&matrix)?;
        let (smallest, largest) = eigen.extremes();
        if !(smallest > 0.0 && largest.is_finite()) {
            return None;
        }
        let p = self.order;
        // The terms are divided by the largest, so that no power overflows.
        let high: Vec<f64> = eigen.values.iter().map(|l| (l / largest).powf(p)).collect();
        let low: Vec<f64> = eigen.values.iter().map(|l| (smallest / l).powf(p)).collect();
        let (high_sum, low_sum) = (high.iter().sum::<f64>(), low.iter().sum::<f64>());
        let value = 0.5 * (largest.ln() - smallest.ln() + (high_sum.ln() + low_sum.ln()) / p);
        let slopes: Vec<f64> =
            eigen.values.iter().enumerate().map(|(k, l)| 0.5 * (high[k] / high_sum - low[k] / low_sum) / l).collect();
        let mut derivative = eigen.weighted(&slopes);
        if self.scaled {
            // Derivative of f(S D S) through the outer factors and through S = diag(D)^-1/2.
            let (d, inner) = (information, derivative);
            derivative = DMatrix::from_fn(d.nrows(), d.ncols(), |i, j| scale[i] * inner[(i, j)] * scale[j]);
            for i in 0..d.nrows() {
                let through_scale: f64 = (0..d.ncols()).map(|j| inner[(i, j)] * scale[i] * d[(i, j)] * scale[j]).sum();
                derivative[(i, i)] -= through_scale / d[(i, i)];
            }
        }
        Some((value, derivative))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        let (matrix, _) = self.scaling(information)?;
        let (smallest, largest) = SymmetricEigen::new(&matrix)?.extremes();
        (smallest > 0.0).then(|| (largest / smallest).sqrt())
    }
}
