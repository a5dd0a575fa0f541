//! A-optimality: the sum of the parameters' variances, `tr D⁻¹`, with the information matrix D.

use super::{Criterion, ValueAndGradient};
use crate::definite_inverse::log_det_and_inverse;
use nalgebra::DMatrix;

/// `log tr D⁻¹`, with derivative `-D⁻² / tr D⁻¹`. The logarithm keeps the step size similar throughout the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AOptimal;

impl Criterion for AOptimal {
    fn name(&self) -> &'static str {
        "a-optimal"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        let (_, inverse) = log_det_and_inverse(information)?;
        let trace = inverse.trace();
        Some((trace.ln(), -(&inverse * &inverse) / trace))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        Some(log_det_and_inverse(information)?.1.trace())
    }
}
