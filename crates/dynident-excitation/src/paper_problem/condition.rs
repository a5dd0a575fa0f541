//! Singular values of a tall matrix with three columns.

/// Singular values and right singular vectors.
#[derive(Clone, Copy, Debug)]
pub(super) struct Singular3 {
    /// Largest first.
    pub(super) values: [f64; 3],
    /// `vectors[k]` belongs to `values[k]`.
    pub(super) vectors: [[f64; 3]; 3],
}

impl Singular3 {
    /// Of the matrix with these rows: triangular factor by Givens rotations, row by row, then one-sided Jacobi rotations of its columns (Golub and Van Loan, *Matrix Computations*,
    /// 2013, sections 5.2 and 8.6). No product of the matrix with itself is formed, so condition numbers are good up to about 1e15.
    pub(super) fn of_rows(rows: impl IntoIterator<Item = [f64; 3]>) -> Self {
        let mut r = [[0.0; 3]; 3];
        for mut row in rows {
            for k in 0..3 {
                if row[k] == 0.0 {
                    continue;
                }
                // Plain square root: entries are of physical size, far from overflow.
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
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
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
                for row in r.iter_mut().chain(&mut v) {
                    (row[a], row[b]) = (cos * row[a] - sin * row[b], sin * row[a] + cos * row[b]);
                }
            }
            if !rotated {
                break;
            }
        }
        let mut order = [0, 1, 2];
        let lengths = [0, 1, 2].map(|k| product(&r, k, k).sqrt());
        order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]));
        Self { values: order.map(|k| lengths[k]), vectors: order.map(|k| [v[0][k], v[1][k], v[2][k]]) }
    }

    /// Largest over smallest singular value; infinite without full rank.
    pub(super) fn condition_number(&self) -> f64 {
        if self.values[2] > 0.0 { self.values[0] / self.values[2] } else { f64::INFINITY }
    }
}
