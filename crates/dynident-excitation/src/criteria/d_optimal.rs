//! D-optimality: the volume of the parameters' confidence ellipsoid, `-log det D`. Does not depend on units or on the choice of base columns, but for a constant.

use super::{Criterion, Valued};
use nalgebra::DMatrix;

/// `-log det D`, with derivative `-D⁻¹`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DOptimal;

impl Criterion for DOptimal {
    fn name(&self) -> &'static str {
        "d-optimal"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> Valued {
        let factor = information.clone().cholesky()?;
        let value = -2.0 * factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        Some((value, -factor.inverse()))
    }

    fn figure(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.value_and_derivative(information).map(|(value, _)| value)
    }
}
