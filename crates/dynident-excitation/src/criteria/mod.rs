//! What makes a motion good: functions of the information `D` with their derivatives. Smaller is better for all of
//! them.

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
pub use worst_directions::WorstDirections;

use nalgebra::DMatrix;

/// A value and its symmetric derivative by `D`; `None` where `D` is not positive definite (some parameter is not
/// excited at all).
pub type ValueAndGradient = Option<(f64, DMatrix<f64>)>;

/// A criterion on the information matrix.
pub trait Criterion: core::fmt::Debug + Send + Sync {
    /// The name in study files and results.
    fn name(&self) -> &'static str;

    /// Value and derivative of the smooth form that optimisers use.
    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient;

    /// About how much the value changes when a motion of so many columns is made larger by half: what searches measure
    /// penalties and steps with.
    fn scale(&self, _columns: usize) -> f64 {
        1.0
    }

    /// What searches measure gradients by. Not the value itself: to a logarithm the unit of every parameter adds.
    fn gradient_scale(&self, columns: usize) -> f64 {
        self.scale(columns)
    }

    /// Whether other units of the columns change the value by a constant only, the same for all informations.
    fn is_free_of_units(&self) -> bool {
        false
    }

    /// Whether many short searches find more than few long ones.
    fn has_many_optima(&self) -> bool {
        false
    }

    /// The figure to report: the criterion itself, without smoothing.
    fn figure(&self, information: &DMatrix<f64>) -> Option<f64>;

    /// A positive form of the figure, smaller is better, for optimisers that choose by 1/H.
    fn fitness(&self, information: &DMatrix<f64>) -> Option<f64> {
        self.figure(information)
    }
}
