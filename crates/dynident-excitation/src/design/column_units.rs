//! Units of the columns in which the entries of the information are near one, for criteria to which units only add a
//! constant.

use super::{DesignTask, ranges};
use crate::criteria::{Criterion, ValueAndGradient};
use crate::information::Information;
use crate::motion::Motion;
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// Seed of the motion that determines the units. All searches of a task must use the same seed.
const SEED: u64 = 1;

/// For each column a power of two near `1 / √D_kk`. Products with powers of two are exact: a robot twice as heavy or
/// long has bit-identical information in these units, so that its search takes the same steps.
pub(super) struct ColumnUnits(Vec<f64>);

impl ColumnUnits {
    pub(super) fn new(task: &DesignTask<'_>, times: &[f64], weight: f64) -> Self {
        let (positions, speeds) = ranges(task.limits);
        let parameters = task.family.random(&positions, &speeds, &mut Random::new(SEED));
        let mut motion = Motion::default();
        task.family.motion(&parameters, times, &mut motion);
        let mut information = Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior);
        Self(information.of(&motion, weight).diagonal().iter().map(|d| near_root(*d).recip()).collect())
    }

    /// Value and derivative of the criterion, in these units if units only add a constant to the criterion.
    pub(super) fn value_and_derivative(
        &self,
        criterion: &dyn Criterion,
        information: &DMatrix<f64>,
    ) -> ValueAndGradient {
        if !criterion.is_free_of_units() {
            return criterion.value_and_derivative(information);
        }
        let (value, derivative) = criterion.value_and_derivative(&self.scaled(information))?;
        Some((value, self.scaled(&derivative)))
    }

    fn scaled(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| self.0[i] * matrix[(i, j)] * self.0[j])
    }
}

/// A power of two near the root of a positive number, which doubles exactly when the number is four times as large; 1
/// for other numbers.
fn near_root(number: f64) -> f64 {
    if !(number.is_normal() && number > 0.0) {
        return 1.0;
    }
    let exponent = (number.to_bits() >> 52) as i32 - 1023;
    2.0_f64.powi(exponent.div_euclid(2))
}

#[cfg(test)]
mod tests {
    use super::near_root;

    #[test]
    fn roots_are_near_and_double_exactly() {
        for number in [1e-200, 3.7e-9, 0.5, 1.0, 1.999_999_999_999_999_8, 2.0, 4.0, 1e150] {
            let root = near_root(number);
            assert!(number / (root * root) >= 1.0 && number / (root * root) < 4.0, "{number}");
            assert_eq!(near_root(4.0 * number), 2.0 * root);
        }
        assert_eq!([0.0, -1.0, f64::INFINITY, f64::NAN].map(near_root), [1.0; 4]);
    }
}
