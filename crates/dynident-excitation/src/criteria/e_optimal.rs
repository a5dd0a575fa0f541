//! E-optimality: the variance along the direction with the largest variance, `1 / λ_min(D)`, with the information
//! matrix D.

use super::{Criterion, ValueAndGradient};
use crate::symmetric_eigen::SymmetricEigen;
use nalgebra::DMatrix;

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
        let eigen = SymmetricEigen::new(information)?;
        let (smallest, _) = eigen.extremes();
        if smallest <= 0.0 || !smallest.is_finite() {
            return None;
        }
        let p = self.order;
        let low: Vec<f64> = eigen.values.iter().map(|l| (smallest / l).powf(p)).collect();
        let sum: f64 = low.iter().sum();
        let slopes: Vec<f64> = eigen.values.iter().zip(&low).map(|(l, share)| -share / (sum * l)).collect();
        Some((-smallest.ln() + sum.ln() / p, eigen.weighted(&slopes)))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        let (smallest, _) = SymmetricEigen::new(information)?.extremes();
        (smallest > 0.0).then(|| smallest.recip())
    }
}
