//! Column space of a matrix, and norms.

use nalgebra::{DMatrix, DVector};

/// Minimum singular value of a basis relative to the largest one.
const MIN_SINGULAR_RATIO: f64 = 1.0e-9;

/// An orthonormal basis of the column space of a matrix. Columns may have different units and may be dependent.
pub(super) struct Span(DMatrix<f64>);

impl Span {
    /// Computes the basis; `None` for an empty matrix.
    pub(super) fn new(mut columns: DMatrix<f64>) -> Option<Self> {
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
        let least = MIN_SINGULAR_RATIO * sizes.max();
        let kept: Vec<usize> = (0..basis.ncols()).filter(|&k| sizes[k] > least).collect();
        Some(Self(basis.select_columns(&kept)))
    }

    /// The component of a vector orthogonal to the space.
    pub(super) fn outside(&self, vector: &DVector<f64>) -> DVector<f64> {
        vector - &self.0 * self.0.tr_mul(vector)
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn norm(values: &[f64]) -> f64 {
    dot(values, values).sqrt()
}

pub(super) fn root_mean_square(values: &[f64]) -> f64 {
    (dot(values, values) / values.len().max(1) as f64).sqrt()
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
