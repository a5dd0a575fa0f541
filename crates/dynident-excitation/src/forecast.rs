//! The forecast: how well each parameter will come out, before the robot moves.

use crate::definite_inverse::log_det_and_inverse;
use nalgebra::{DMatrix, SymmetricEigen};

/// What an experiment with this information will say.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// Standard deviation of every parameter's estimate, `√(D⁻¹)_kk`.
    pub std: Vec<f64>,
    /// The directions that will be known worst, worst first.
    pub worst: Vec<Direction>,
}

/// A combination of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Direction {
    /// Standard deviation along it, in the units of its largest parameter.
    pub std: f64,
    /// Index and share of the parameters that make it up, largest first; shares below a tenth of the largest are left out.
    pub parts: Vec<(usize, f64)>,
}

/// Directions reported.
const WORST: usize = 3;

/// Forecast of weighted least squares from the information `D = Σ_j W_jᵀ W_j / σ_j²` of a motion: the estimate's covariance is `D⁻¹` when the torque errors are independent with the assumed σ_j
/// (Swevers et al. 1997). Residuals that are correlated in time make the real error bars larger, by 1.3 to 9 times on known arms. `None` when the motion does not excite every parameter.
///
/// Directions are eigenvectors of `D` with every parameter measured in the size that `scale` gives it (its prior value, say; 1 for as it is).
///
/// # Panics
/// If there is not one scale per parameter.
pub fn forecast(information: &DMatrix<f64>, scale: &[f64]) -> Option<Forecast> {
    let count = information.nrows();
    assert_eq!(scale.len(), count, "one scale per parameter");
    let (_, covariance) = log_det_and_inverse(information)?;
    let std: Vec<f64> = covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect();
    let relative = DMatrix::from_fn(count, count, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let eigen = SymmetricEigen::new(relative);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let direction = |&k: &usize| {
        let vector = eigen.eigenvectors.column(k);
        let largest = vector.amax();
        let mut parts: Vec<(usize, f64)> = vector
            .iter()
            .enumerate()
            .filter(|(_, share)| share.abs() >= 0.1 * largest)
            .map(|(index, share)| (index, share / largest))
            .collect();
        parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()).then(a.0.cmp(&b.0)));
        Direction { std: eigen.eigenvalues[k].max(0.0).sqrt(), parts }
    };
    Some(Forecast { std, worst: order.iter().take(WORST).map(direction).collect() })
}
