//! V-optimality: the error with which the identified model predicts torque along a given motion (the task).

use super::{Criterion, ValueAndGradient};
use crate::definite_inverse::log_det_and_inverse;
use nalgebra::DMatrix;

/// `log tr(D⁻¹ M)` with `M = Σ W_taskᵀ Σ⁻¹ W_task / samples` and derivative `-D⁻¹ M D⁻¹ / tr(D⁻¹ M)`. D is the
/// information matrix of the excitation motion, W_task the regressor of the task, and Σ⁻¹ the inverse covariance of
/// the torque noise.
///
/// The covariance of a torque prediction `W_task θ̂` is `W_task D⁻¹ W_taskᵀ`. `tr(D⁻¹ M)` is its trace, with each
/// joint scaled by its torque noise, averaged over the samples of the task. It is the mean square of the prediction
/// error due to the parameters' uncertainty, summed over all joints, in units of the torque noise's variance.
/// Fedorov, Theory of Optimal Experiments (1972), section 2.7; called V- or I-optimality.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    task: DMatrix<f64>,
}

impl Prediction {
    /// Creates the criterion for the matrix `M` = `task` of a task: symmetric, positive semi-definite, in the columns
    /// of the information matrix. [`Information::of`](crate::Information::of) computes it from the motion of the task
    /// with the weight `1 / samples`.
    pub fn new(task: DMatrix<f64>) -> Self {
        Self { task }
    }
}

impl Criterion for Prediction {
    fn name(&self) -> &'static str {
        "prediction"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        let (_, inverse) = log_det_and_inverse(information)?;
        let spread = &inverse * &self.task;
        let trace = spread.trace();
        (trace > 0.0 && trace.is_finite()).then(|| (trace.ln(), -(spread * inverse) / trace))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        let (_, inverse) = log_det_and_inverse(information)?;
        Some(inverse.component_mul(&self.task).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criteria::AOptimal;
    use crate::criteria::testing::{check_derivative, random_definite};
    use dynident_model::sample::Random;

    /// With M = 1 the criterion is A-optimality; with M = D the result is the number of parameters.
    #[test]
    fn known_cases() {
        let mut random = Random::new(3);
        let information = random_definite(&mut random, 9);
        let unit = Prediction::new(DMatrix::identity(9, 9));
        let (value, derivative) = unit.value_and_derivative(&information).unwrap();
        let (a_value, a_derivative) = AOptimal.value_and_derivative(&information).unwrap();
        assert!((value - a_value).abs() < 1e-12 && (derivative - a_derivative).amax() < 1e-12);
        let own = Prediction::new(information.clone());
        assert!((own.figure(&information).unwrap() - 9.0).abs() < 1e-11);
        assert!(unit.value_and_derivative(&DMatrix::zeros(9, 9)).is_none());
        assert!(Prediction::new(DMatrix::zeros(9, 9)).value_and_derivative(&information).is_none());
    }

    #[test]
    fn derivative_is_the_slope() {
        let mut random = Random::new(8);
        let (information, task) = (random_definite(&mut random, 7), random_definite(&mut random, 7));
        let criterion = Prediction::new(task);
        check_derivative(&criterion, &information, &mut random);
        let (value, _) = criterion.value_and_derivative(&information).unwrap();
        let figure = criterion.figure(&information).unwrap();
        assert!((value.exp() - figure).abs() < 1e-12 * figure.max(1.0));
    }
}
