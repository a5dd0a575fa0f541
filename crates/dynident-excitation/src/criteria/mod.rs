//! Optimality criteria: functions of the information matrix `D` with their derivatives. Smaller is better.

mod a_optimal;
mod condition_number;
mod d_optimal;
mod e_optimal;
mod prediction;
mod worst_directions;

pub use a_optimal::AOptimal;
pub use condition_number::ConditionNumber;
pub use d_optimal::DOptimal;
pub use e_optimal::EOptimal;
pub use prediction::Prediction;
pub use worst_directions::KieferPhiP;

use nalgebra::DMatrix;

/// Value of a criterion and its symmetric derivative with respect to `D`; `None` if `D` is not positive definite,
/// which means that the motion does not excite some parameter.
pub type ValueAndGradient = Option<(f64, DMatrix<f64>)>;

/// A criterion on the information matrix.
pub trait Criterion: core::fmt::Debug + Send + Sync {
    /// The name in study files and results.
    fn name(&self) -> &'static str;

    /// Value and derivative of the smooth form that the optimisers minimise.
    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient;

    /// Approximate change of the value when a motion with this number of columns is enlarged by a factor of 1.5.
    /// Searches scale penalties and steps by it.
    fn scale(&self, _columns: usize) -> f64 {
        1.0
    }

    /// Scale of the gradients. It can differ from the scale of the value: the value of a logarithmic criterion
    /// contains a constant that depends on the units of the parameters.
    fn gradient_scale(&self, columns: usize) -> f64 {
        self.scale(columns)
    }

    /// Whether other units of the columns only add a constant to the value, equal for all information matrices.
    fn is_free_of_units(&self) -> bool {
        false
    }

    /// Whether the criterion has many local optima, so that many short searches are better than few long ones.
    fn has_many_optima(&self) -> bool {
        false
    }

    /// Value for reports: the criterion without smoothing.
    fn figure(&self, information: &DMatrix<f64>) -> Option<f64>;

    /// Positive form of the reported value (smaller is better), for optimisers that select by its reciprocal.
    fn fitness(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.figure(information)
    }
}

#[cfg(test)]
mod testing {
    use super::{Criterion, DMatrix};
    use dynident_model::sample::Random;

    pub(super) fn random_definite(random: &mut Random, size: usize) -> DMatrix<f64> {
        let root = DMatrix::from_fn(3 * size, size, |_, _| random.normal());
        root.transpose() * root
    }

    /// Compares the derivative with central differences of fourth order along a random direction. Step 1e-3: truncation
    /// error 1e-12, rounding error 1e-13.
    pub(super) fn check_derivative(criterion: &dyn Criterion, information: &DMatrix<f64>, random: &mut Random) {
        let size = information.nrows();
        let root = DMatrix::from_fn(size, size, |_, _| random.normal());
        let direction = &root + root.transpose();
        let (_, derivative) = criterion.value_and_derivative(information).unwrap();
        let at = |step: f64| criterion.value_and_derivative(&(information + &direction * step)).unwrap().0;
        let step = 1e-3;
        let slope = (8.0 * (at(step) - at(-step)) - (at(2.0 * step) - at(-2.0 * step))) / (12.0 * step);
        let expected = derivative.component_mul(&direction).sum();
        assert!((slope - expected).abs() < 1e-8 * expected.abs().max(1.0), "{slope} {expected}");
    }
}
