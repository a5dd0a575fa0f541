//! Singular values of a tall matrix with three columns.

#[derive(Clone, Copy, Debug)]
pub(super) struct Singular3([f64; 3]);

impl Singular3 {
    /// Computes the singular values of the matrix with these rows. Givens rotations reduce the rows to a triangular
    /// factor one by one; one-sided Jacobi rotations of its columns follow (Golub and Van Loan, *Matrix
    /// Computations*, 2013, sections 5.2 and 8.6). The matrix is not squared, so that condition numbers up to about
    /// 1e15 are accurate.
    pub(super) fn of_rows(rows: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut r = [[0.0; 3]; 3];
        for mut row in rows {
            for k in 0..3 {
                if row[k] == 0.0 {
                    continue;
                }
                // A plain square root neither overflows nor underflows for entries of physical size.
                let length = (r[k][k] * r[k][k] + row[k] * row[k]).sqrt();
                let (cos, sin) = (r[k][k] / length, row[k] / length);
                for column in k..3 {
                    let (above, below) = (r[k][column], row[column]);
                    r[k][column] = cos * above + sin * below;
                    row[column] = cos * below - sin * above;
                }
            }
        }
        Self::of_triangle(r)
    }

    fn of_triangle(mut r: [[f64; 3]; 3]) -> Self {
        let product = |r: &[[f64; 3]; 3], a: usize, b: usize| -> f64 { r.iter().map(|row| row[a] * row[b]).sum() };
        // Converges quadratically; six sweeps are usual.
        for _ in 0..30 {
            let mut rotated = false;
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let (aa, bb, ab) = (product(&r, a, a), product(&r, b, b), product(&r, a, b));
                if ab.abs() <= 1e-16 * (aa * bb).sqrt() {
                    continue;
                }
                rotated = true;
                let zeta = (bb - aa) / (2.0 * ab);
                let tan = zeta.signum() / (zeta.abs() + (1.0 + zeta * zeta).sqrt());
                let cos = 1.0 / (1.0 + tan * tan).sqrt();
                let sin = cos * tan;
                for row in &mut r {
                    (row[a], row[b]) = (cos * row[a] - sin * row[b], sin * row[a] + cos * row[b]);
                }
            }
            if !rotated {
                break;
            }
        }
        let mut values = [0, 1, 2].map(|k| product(&r, k, k).sqrt());
        values.sort_by(|a, b| b.total_cmp(a));
        Self(values)
    }

    /// Ratio of the largest to the smallest singular value; infinite if the rank is not full.
    pub(super) fn condition_number(&self) -> f64 {
        if self.0[2] > 0.0 { self.0[0] / self.0[2] } else { f64::INFINITY }
    }
}
