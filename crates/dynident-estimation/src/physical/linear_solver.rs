//! Symmetric positive definite systems: scaled to a unit diagonal, factored by blocks, refined once.

use nalgebra::{DMatrix, DVector};

/// Columns factored at a time: small enough for the first-level cache, large enough that the rest is matrix products.
const PANEL: usize = 48;

/// A factored system.
#[derive(Clone, Debug)]
pub(super) struct DefiniteSystem {
    matrix: DMatrix<f64>,
    factor: DMatrix<f64>,
    scale: DVector<f64>,
}

impl DefiniteSystem {
    /// Factors `D A D = L Lᵀ` with `D = diag(A)^{-1/2}`; where rounding hides that it is positive definite, the least that helps is added to the unit diagonal.
    /// None when the matrix is not positive semidefinite within 1e-6, or not finite.
    pub(super) fn new(matrix: DMatrix<f64>) -> Option<Self> {
        let diagonal = matrix.diagonal();
        if !diagonal.iter().all(|&value| value > 0.0 && value.is_finite()) {
            return None;
        }
        let scale = diagonal.map(|value| 1.0 / value.sqrt());
        let size = matrix.nrows();
        let mut added = 0.0;
        loop {
            let mut factor = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
            for k in 0..size {
                factor[(k, k)] = 1.0 + added;
            }
            if factored(&mut factor) {
                return Some(Self { matrix, factor, scale });
            }
            added = if added == 0.0 { 1.0e-14 } else { 10.0 * added };
            if added > 1.0e-6 {
                return None;
            }
        }
    }

    /// Solves, with up to three steps of refinement against the matrix as given, each kept only if it helps.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut x = self.solve_once(right);
        let mut rest = right - &self.matrix * &x;
        let mut size = rest.component_mul(&self.scale).norm();
        for _ in 0..3 {
            let next = &x + self.solve_once(&rest);
            let next_rest = right - &self.matrix * &next;
            let next_size = next_rest.component_mul(&self.scale).norm();
            if next_size.is_nan() || next_size >= 0.5 * size {
                break;
            }
            (x, rest, size) = (next, next_rest, next_size);
        }
        x
    }

    fn solve_once(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut y = right.component_mul(&self.scale);
        // The diagonal is positive, so neither triangle can fail.
        let _ = self.factor.solve_lower_triangular_mut(&mut y);
        let _ = self.factor.tr_solve_lower_triangular_mut(&mut y);
        y.component_mul_assign(&self.scale);
        y
    }
}

/// Replaces the lower triangle by the Cholesky factor, right-looking by panels (Golub and Van Loan 4.2.9); false when a pivot is not positive.
fn factored(a: &mut DMatrix<f64>) -> bool {
    let size = a.nrows();
    let mut first = 0;
    while first < size {
        let width = PANEL.min(size - first);
        let next = first + width;
        for j in first..next {
            for k in first..j {
                let factor = a[(j, k)];
                let (left, mut right) = a.columns_range_pair_mut(k, j);
                right.rows_mut(j, size - j).axpy(-factor, &left.rows(j, size - j), 1.0);
            }
            let pivot = a[(j, j)];
            if pivot.is_nan() || pivot <= 1.0e-16 {
                return false;
            }
            let root = 1.0 / pivot.sqrt();
            let mut column = a.view_mut((j, j), (size - j, 1));
            column *= root;
        }
        // The trailing matrix, panel by panel, so that only the lower triangle is computed.
        let panel = a.view((next, first), (size - next, width)).into_owned();
        let mut start = next;
        while start < size {
            let columns = PANEL.min(size - start);
            let left = panel.rows(start - next, size - start);
            let right = panel.rows(start - next, columns).transpose();
            a.view_mut((start, start), (size - start, columns)).gemm(-1.0, &left, &right, 1.0);
            start += columns;
        }
        first = next;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_what_it_factors_at_sizes_around_the_panel() {
        for size in [1, 47, 48, 49, 130] {
            let a = DMatrix::from_fn(size, size, |i, j| ((i * 13 + j * 7) as f64 * 0.37).sin());
            let matrix = a.tr_mul(&a) + DMatrix::identity(size, size) * 1.0e-3;
            let x = DVector::from_fn(size, |i, _| (i as f64).cos());
            let found = DefiniteSystem::new(matrix.clone()).unwrap().solve(&(&matrix * &x));
            // Condition up to 1e7 times rounding.
            assert!((found - x).amax() < 1e-7, "{size}");
        }
    }

    #[test]
    fn an_indefinite_or_broken_matrix_is_none() {
        assert!(DefiniteSystem::new(DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_none());
        assert!(DefiniteSystem::new(DMatrix::from_row_slice(1, 1, &[f64::NAN])).is_none());
        assert!(DefiniteSystem::new(DMatrix::from_row_slice(2, 2, &[1.0, f64::NAN, f64::NAN, 1.0])).is_none());
    }
}
