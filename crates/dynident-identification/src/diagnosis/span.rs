//! The space that some columns span, and what of a vector lies outside.

use nalgebra::{DMatrix, DVector};

/// Share of the largest singular value below which a direction is none.
const SINGULAR: f64 = 1.0e-9;

/// An orthonormal basis of the columns of a matrix, whatever their units; dependent ones are no harm.
pub(super) struct Span(DMatrix<f64>);

impl Span {
    /// Of these columns; none where there are no rows.
    pub(super) fn new(mut columns: DMatrix<f64>) -> Option<Self> {
        // Of nothing there is no decomposition.
        if columns.is_empty() {
            return None;
        }
        for mut column in columns.column_iter_mut() {
            let size = column.norm();
            if size > 0.0 {
                column /= size;
            }
        }
        let decomposition = columns.svd(true, false);
        let (basis, sizes) = (decomposition.u?, decomposition.singular_values);
        let least = SINGULAR * sizes.max();
        let kept: Vec<usize> = (0..basis.ncols()).filter(|&k| sizes[k] > least).collect();
        Some(Self(basis.select_columns(&kept)))
    }

    /// What of a vector lies outside.
    pub(super) fn outside(&self, vector: &DVector<f64>) -> DVector<f64> {
        vector - &self.0 * self.0.tr_mul(vector)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_rows_span_nothing() {
        assert!(Span::new(DMatrix::zeros(0, 4)).is_none());
        assert!(Span::new(DMatrix::zeros(3, 0)).is_none());
    }
}
