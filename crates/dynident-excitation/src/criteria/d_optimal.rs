//! D-optimality: the volume of the confidence ellipsoid of the parameters, as `-log det D` of the information matrix
//! D. Other units or other base columns only add a constant.

use super::{Criterion, ValueAndGradient};
use crate::definite_inverse::log_det_and_inverse;
use nalgebra::DMatrix;

/// `-log det D`, with derivative `-D⁻¹`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DOptimal;

impl Criterion for DOptimal {
    fn name(&self) -> &'static str {
        "d-optimal"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        let (log_det, inverse) = log_det_and_inverse(information)?;
        Some((-log_det, -inverse))
    }

    fn scale(&self, columns: usize) -> f64 {
        columns as f64
    }

    fn is_free_of_units(&self) -> bool {
        true
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.value_and_derivative(information).map(|(value, _)| value)
    }

    /// `(det D)^(-1/n)`, the geometric mean of the variances along the axes of the ellipsoid.
    fn fitness(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.figure(information).map(|figure| (figure / information.nrows() as f64).exp())
    }
}
