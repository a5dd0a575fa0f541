//! Kiefer's φ_p criterion between A- and E-optimality, in given units of the parameters.

use super::{Criterion, ValueAndGradient};
use crate::symmetric_eigen::SymmetricEigen;
use nalgebra::DMatrix;

/// `log ‖1/λ‖_p` of the eigenvalues λ of `Tᵀ D T`, with derivative `-T U diag(λ^(-p-1)) Uᵀ Tᵀ / Σ λ^-p`. D is the
/// information matrix; the columns of T are the units in which the parameters θ are measured, `θ = T x`. The value is
/// the p-norm of the variances along the axes of the confidence ellipsoid of `x`. Order 1 is A-optimality of x (mean
/// variance), infinity is E-optimality (largest variance); an order in between weights the directions with the
/// largest variances. Kiefer, Annals of Statistics 2 (1974) 849; Pukelsheim, Optimal Design of Experiments (1993),
/// chapter 6.
///
/// With `T Tᵀ = M⁻¹`, where M is the mean information of a sample of some motions, the variances are those of the
/// torque predicted along these motions. Order 1 is then [`Prediction`](super::Prediction). For D-optimality (`-log
/// det`), doubling the information of a well determined direction gains as much as doubling that of a poorly
/// determined direction; this criterion prefers the latter.
#[derive(Clone, Debug, PartialEq)]
pub struct KieferPhiP {
    units: DMatrix<f64>,
    order: f64,
}

impl KieferPhiP {
    /// Creates the criterion with T = `units` and the order of the norm (positive). The columns of T are steps of θ of
    /// equal importance; T is square and regular, with one row for each column of the information matrix.
    pub fn new(units: DMatrix<f64>, order: f64) -> Self {
        Self { units, order }
    }
}

impl Criterion for KieferPhiP {
    fn name(&self) -> &'static str {
        "worst-directions"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        if self.units.shape() != information.shape() {
            return None;
        }
        let eigen = SymmetricEigen::new(&(self.units.tr_mul(information) * &self.units))?;
        let (smallest, _) = eigen.extremes();
        if !(smallest > 0.0 && smallest.is_finite()) {
            return None;
        }
        // The terms are divided by the largest, so that no power overflows.
        let shares: Vec<f64> = eigen.values.iter().map(|value| (smallest / value).powf(self.order)).collect();
        let sum: f64 = shares.iter().sum();
        let slopes: Vec<f64> = eigen.values.iter().zip(&shares).map(|(value, share)| -share / (sum * value)).collect();
        let derivative = &self.units * eigen.weighted(&slopes) * self.units.transpose();
        Some((sum.ln() / self.order - smallest.ln(), derivative))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.value_and_derivative(information).map(|(value, _)| value.exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::testing::{check_derivative, random_definite};
    use crate::criteria::{EOptimal, Prediction};
    use dynident_model::sample::Random;

    /// Order 1 in units of a task equals the torque prediction, order 40 the smooth E-optimality.
    #[test]
    fn known_cases() {
        let mut random = Random::new(3);
        let (information, task) = (random_definite(&mut random, 9), random_definite(&mut random, 9));
        let units = task.clone().cholesky().unwrap().l().try_inverse().unwrap().transpose();
        let value = |order| KieferPhiP::new(units.clone(), order).value_and_derivative(&information).unwrap().0;
        let expected = Prediction::new(task).value_and_derivative(&information).unwrap().0;
        assert!((value(1.0) - expected).abs() < 1e-10, "{} {expected}", value(1.0));
        let expected = EOptimal::default().value_and_derivative(&(units.tr_mul(&information) * &units)).unwrap().0;
        assert!((value(40.0) - expected).abs() < 1e-10, "{} {expected}", value(40.0));
        assert!(KieferPhiP::new(units, 2.0).value_and_derivative(&DMatrix::zeros(9, 9)).is_none());
        assert!(KieferPhiP::new(DMatrix::identity(8, 8), 2.0).figure(&information).is_none());
    }

    #[test]
    fn derivative_is_the_slope() {
        let mut random = Random::new(8);
        let information = random_definite(&mut random, 7);
        let units = DMatrix::from_fn(7, 7, |_, _| random.normal());
        check_derivative(&KieferPhiP::new(units, 2.0), &information, &mut random);
    }
}
