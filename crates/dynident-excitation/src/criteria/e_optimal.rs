//! E-optimality: the variance along the worst direction, `1 / λ_min(D)`.

use super::{Criterion, ValueAndGradient};
use nalgebra::{DMatrix, SymmetricEigen};

/// `log ‖1/λ‖_p`, a smooth bound on `-log λ_min`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EOptimal {
    /// Order of the norm, positive.
    pub order: f64,
}

impl Default for EOptimal {
    fn default() -> Self {
        Self { order: 40.0 }
    }
}

impl Criterion for EOptimal {
    fn name(&self) -> &'static str {
        "e-optimal"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        let eigen = SymmetricEigen::new(information.clone());
        let smallest = eigen.eigenvalues.min();
        if smallest <= 0.0 || !smallest.is_finite() {
            return None;
        }
        let p = self.order;
        let low: Vec<f64> = eigen.eigenvalues.iter().map(|l| (smallest / l).powf(p)).collect();
        let sum: f64 = low.iter().sum();
        let mut vectors = eigen.eigenvectors.clone();
        for ((mut column, l), share) in vectors.column_iter_mut().zip(eigen.eigenvalues.iter()).zip(&low) {
            column *= -share / (sum * l);
        }
        Some((-smallest.ln() + sum.ln() / p, vectors * eigen.eigenvectors.transpose()))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        let smallest = SymmetricEigen::new(information.clone()).eigenvalues.min();
        (smallest > 0.0).then(|| smallest.recip())
    }
}
