//! The worst known directions, each parameter on a scale of its own: Kiefer's φ_p between A- and E-optimality.

use super::{Criterion, ValueAndGradient};
use nalgebra::{DMatrix, SymmetricEigen};

/// `log ‖1/λ‖_p` of the eigenvalues λ of `S D S`, `S = diag(scale)`, with derivative `-S U diag(λ^(-p-1)) Uᵀ S / Σ
/// λ^-p`: the p-norm of the variances along the axes of the confidence ellipsoid of `S⁻¹ θ`. Order 1 is A-optimality of
/// the scaled parameters (the mean variance), infinity E-optimality (the largest); in between the worst directions have
/// the say, and not one alone. Kiefer, Annals of Statistics 2 (1974) 849; Pukelsheim, Optimal Design of Experiments
/// (1993), chapter 6.
///
/// Unlike D-optimality it asks where information is missing: `-log det` gains as much by twice the information of a
/// direction that is known well as by twice that of one that is hardly known. It depends on units, and so needs the
/// scale.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstDirections {
    scale: Vec<f64>,
    order: f64,
}

impl WorstDirections {
    /// With what counts as one unit of every parameter (positive, in the order of the information's columns), and the
    /// order of the norm (positive).
    pub fn new(scale: Vec<f64>, order: f64) -> Self {
        Self { scale, order }
    }

    /// `S M S`.
    fn scaled(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| self.scale[i] * matrix[(i, j)] * self.scale[j])
    }
}

impl Criterion for WorstDirections {
    fn name(&self) -> &'static str {
        "worst-directions"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        if self.scale.len() != information.nrows() {
            return None;
        }
        let eigen = SymmetricEigen::new(self.scaled(information));
        let smallest = eigen.eigenvalues.min();
        if !(smallest > 0.0 && smallest.is_finite()) {
            return None;
        }
        // Relative to the largest term, so that no power overflows.
        let shares: Vec<f64> = eigen.eigenvalues.iter().map(|value| (smallest / value).powf(self.order)).collect();
        let sum: f64 = shares.iter().sum();
        let mut vectors = eigen.eigenvectors.clone();
        for ((mut column, value), share) in vectors.column_iter_mut().zip(eigen.eigenvalues.iter()).zip(&shares) {
            column *= -share / (sum * value);
        }
        let derivative = self.scaled(&(vectors * eigen.eigenvectors.transpose()));
        Some((sum.ln() / self.order - smallest.ln(), derivative))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.value_and_derivative(information).map(|(value, _)| value.exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::{AOptimal, EOptimal};
    use dynident_model::sample::Random;

    fn random_definite(random: &mut Random, size: usize) -> DMatrix<f64> {
        let root = DMatrix::from_fn(3 * size, size, |_, _| random.normal());
        root.transpose() * root
    }

    /// Order 1 is A-optimality, order 40 the smooth E-optimality, of the parameters measured in the scale.
    #[test]
    fn known_cases() {
        let mut random = Random::new(3);
        let information = random_definite(&mut random, 9);
        let scale: Vec<f64> = (0..9).map(|k| 0.5 + 0.3 * f64::from(k)).collect();
        let scaled = DMatrix::from_fn(9, 9, |i, j| scale[i] * information[(i, j)] * scale[j]);
        for (order, other) in [(1.0, &AOptimal as &dyn Criterion), (40.0, &EOptimal::default())] {
            let (value, _) = WorstDirections::new(scale.clone(), order).value_and_derivative(&information).unwrap();
            let (expected, _) = other.value_and_derivative(&scaled).unwrap();
            // Condition of some tens, sums of nine terms.
            assert!((value - expected).abs() < 1e-11, "{order}: {value} {expected}");
        }
        assert!(WorstDirections::new(scale.clone(), 2.0).value_and_derivative(&DMatrix::zeros(9, 9)).is_none());
        assert!(WorstDirections::new(scale[1..].to_vec(), 2.0).figure(&information).is_none());
    }

    /// The derivative against central differences of fourth order: step 1e-3 leaves 1e-12 of truncation, rounding
    /// 1e-13.
    #[test]
    fn derivative_is_the_slope() {
        let mut random = Random::new(8);
        let information = random_definite(&mut random, 7);
        let criterion = WorstDirections::new((0..7).map(|k| 1.0 + 0.2 * f64::from(k)).collect(), 2.0);
        let root = DMatrix::from_fn(7, 7, |_, _| random.normal());
        let direction = &root + root.transpose();
        let (_, derivative) = criterion.value_and_derivative(&information).unwrap();
        let at = |step: f64| criterion.value_and_derivative(&(&information + &direction * step)).unwrap().0;
        let step = 1e-3;
        let slope = (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
        let expected = derivative.component_mul(&direction).sum();
        assert!((slope - expected).abs() < 1e-8 * expected.abs().max(1.0), "{slope} {expected}");
    }
}
