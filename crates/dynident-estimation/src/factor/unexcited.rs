//! Columns that the data do not excite, and the sensitivity of the estimate to their held values.

use crate::error::EstimationError;
use nalgebra::DMatrix;

/// Columns that the data do not excite.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unexcited {
    /// All unexcited columns, ascending: they contain only noise and combinations of other columns.
    pub columns: Vec<usize>,
    /// The unexcited columns with noise only, ascending: combinations of other columns are not above the noise.
    pub silent: Vec<usize>,
}

impl Unexcited {
    /// The same columns with new indices; columns without a new index are dropped.
    pub fn renumbered(&self, number: impl Fn(usize) -> Option<usize>) -> Self {
        let of = |columns: &[usize]| columns.iter().filter_map(|&column| number(column)).collect();
        Self { columns: of(&self.columns), silent: of(&self.silent) }
    }
}

/// Sensitivity of the estimated columns F to the held columns H: `∂θ_F/∂θ_H = −(W_FᵀW_F)⁻¹ W_FᵀW_H`, shape (free,
/// held).
pub(crate) fn answer_of_free(
    triangle: &DMatrix<f64>,
    free: &[usize],
    held: &[usize],
) -> Result<DMatrix<f64>, EstimationError> {
    let mut own = triangle.select_columns(free);
    let norms: Vec<f64> = own.column_iter().map(|column| column.norm()).collect();
    for (mut column, norm) in own.column_iter_mut().zip(&norms) {
        column /= if *norm > 0.0 { *norm } else { 1.0 };
    }
    let factor = own.qr();
    let mut solved = factor.q().tr_mul(&triangle.select_columns(held));
    if !factor.r().solve_upper_triangular_mut(&mut solved) {
        return Err(EstimationError::Overflow { name: "an estimated column".into() });
    }
    for (row, norm) in norms.iter().enumerate() {
        solved.row_mut(row).scale_mut(-1.0 / if *norm > 0.0 { *norm } else { 1.0 });
    }
    Ok(solved)
}
