//! Steps of the search: the minimum of a quadratic model of the cost within a trust region.
//!
//! Many unknowns of a servo arm have nearly the same effect (friction and weight, a common value and those of the
//! joints). A Newton step is then very long in directions that the motion hardly determines. The trust region limits
//! mainly these directions. A shorter step along the Newton direction would hardly progress in the others (Moré and
//! Sorensen, SIAM J. Sci. Stat. Comput. 4, 1983).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Number of bisections for the Lagrange multiplier; its relative error is then below 1e-6.
const BISECTIONS: usize = 60;
/// Range of the multiplier, relative to the largest absolute eigenvalue.
const LEAST_MULTIPLIER: f64 = 1e-12;
const LARGEST_MULTIPLIER: f64 = 1e12;

/// Quadratic model of half of the cost: `-momentᵀ d + dᵀ hessian d / 2` for a step `d`.
pub(crate) struct Quadratic {
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
    /// Moment in the directions of the eigenvectors.
    moment: DVector<f64>,
    scales: DVector<f64>,
}

/// A step of the search.
pub(crate) struct TrustStep {
    pub(crate) change: DVector<f64>,
    /// Expected decrease of the cost.
    pub(crate) expected: f64,
    /// Length of the step, each coordinate divided by its scale.
    pub(crate) length: f64,
}

impl Quadratic {
    /// The model with these scales of the coordinates, in which the trust region is a sphere.
    pub(crate) fn new(hessian: &DMatrix<f64>, moment: &DVector<f64>, scales: DVector<f64>) -> Self {
        let scaled = DMatrix::from_fn(scales.len(), scales.len(), |i, j| hessian[(i, j)] * scales[i] * scales[j]);
        let eigen = scaled.symmetric_eigen();
        let moment = eigen.eigenvectors.tr_mul(&moment.component_mul(&scales));
        Self { eigen, moment, scales }
    }

    /// The best step that is not longer than `radius`.
    pub(crate) fn step(&self, radius: f64) -> TrustStep {
        let values = &self.eigen.eigenvalues;
        let at = |multiplier: f64| self.moment.zip_map(values, |moment, value| moment / (value + multiplier));
        let largest = values.amax().max(f64::MIN_POSITIVE);
        let least = values.min();
        // The multiplier with which the matrix is positive definite.
        let positive = (LEAST_MULTIPLIER * largest - least).max(0.0);
        let mut own = at(positive);
        if own.norm() > radius {
            let (mut low, mut high) = (LEAST_MULTIPLIER.ln(), LARGEST_MULTIPLIER.ln());
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (low + high);
                let is_short = at(positive + middle.exp() * largest).norm() <= radius;
                (low, high) = if is_short { (low, middle) } else { (middle, high) };
            }
            own = at(positive + high.exp() * largest);
        }
        let curved = own.zip_map(values, |own, value| own * own * value).sum();
        TrustStep {
            length: own.norm(),
            // The cost is twice the model.
            expected: 2.0 * own.dot(&self.moment) - curved,
            change: (&self.eigen.eigenvectors * own).component_mul(&self.scales),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> (DMatrix<f64>, DVector<f64>) {
        let root = DMatrix::from_fn(4, 4, |i, j| ((i * i + 5 * j * j * (i + 1) + 1) as f64).sin());
        (&root * root.transpose(), DVector::from_fn(4, |i, _| (i as f64 + 0.3).cos()))
    }

    fn value(hessian: &DMatrix<f64>, moment: &DVector<f64>, step: &DVector<f64>) -> f64 {
        step.dot(&(hessian * step)) - 2.0 * step.dot(moment)
    }

    #[test]
    fn a_large_region_gives_the_newton_step() {
        let (hessian, moment) = model();
        let step = Quadratic::new(&hessian, &moment, DVector::from_vec(vec![1.0, 0.1, 3.0, 0.5])).step(1e9);
        assert!((&hessian * &step.change - &moment).norm() < 1e-6);
        assert!((step.expected + value(&hessian, &moment, &step.change)).abs() < 1e-9);
    }

    /// Also for a matrix that is not positive definite, no other step in the region is better.
    #[test]
    fn no_step_in_the_region_is_better() {
        let (mut hessian, moment) = model();
        let scales = DVector::from_vec(vec![1.0, 0.1, 3.0, 0.5]);
        for shift in [0.0, 0.5] {
            hessian -= shift * DMatrix::<f64>::identity(4, 4);
            let step = Quadratic::new(&hessian, &moment, scales.clone()).step(0.2);
            assert!(step.length <= 0.2 && step.length > 0.19, "{}", step.length);
            let best = value(&hessian, &moment, &step.change);
            for k in 0..2000 {
                let direction = DVector::from_fn(4, |i, _| ((k * (7 * i + 3) + i + 1) as f64).sin());
                let other = (0.2 / direction.norm()) * direction.component_mul(&scales);
                assert!(value(&hessian, &moment, &other) >= best - 1e-9, "{k}");
            }
        }
    }
}
