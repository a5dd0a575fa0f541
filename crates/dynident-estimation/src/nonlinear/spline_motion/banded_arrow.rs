//! A symmetric matrix with a band for the first unknowns and full rows for the last ones:
//!
//! ```text
//!     H = [ B   A ]     B banded, size × size;  A dense, size × arrow;  D dense, arrow × arrow
//!         [ Aᵀ  D ]
//! ```
//!
//! The band is the motion of a log, the arrow the parameters. `B = L Lᵀ` costs `size · bandwidth²`; the Schur
//! complement of the arrow is `D − (L⁻¹A)ᵀ(L⁻¹A)`, and the inverse inside the band follows from L alone (Takahashi,
//! Fagan and Chin 1973; Rasmussen and Williams, Gaussian Processes for Machine Learning, B.3).

use nalgebra::DMatrix;

/// The matrix, with a right-hand side.
#[derive(Clone, Debug)]
pub(super) struct BandedArrow {
    size: usize,
    bandwidth: usize,
    arrow: usize,
    /// Row `i`, columns `i − bandwidth ..= i`; those before the first column are zero.
    band: Vec<f64>,
    /// Row-major.
    side: Vec<f64>,
    /// Lower triangle, row-major.
    corner: Vec<f64>,
    right: Vec<f64>,
    right_corner: Vec<f64>,
}

impl BandedArrow {
    /// Zero matrix for unknowns coupled to `bandwidth` neighbours on either side.
    pub(super) fn new(size: usize, bandwidth: usize, arrow: usize) -> Self {
        Self {
            size,
            bandwidth,
            arrow,
            band: vec![0.0; size * (bandwidth + 1)],
            side: vec![0.0; size * arrow],
            corner: vec![0.0; arrow * arrow],
            right: vec![0.0; size],
            right_corner: vec![0.0; arrow],
        }
    }

    /// Adds `x xᵀ` and `x r` for a row with the entries `own` from unknown `first` on and `arrow` (the whole arrow).
    pub(super) fn add_row(&mut self, first: usize, own: &[f64], arrow: &[f64], r: f64) {
        let (wide, a) = (self.bandwidth + 1, self.arrow);
        for (k, &x) in own.iter().enumerate() {
            if x == 0.0 {
                continue;
            }
            let row = first + k;
            let end = row * wide + self.bandwidth + 1;
            axpy(x, &own[..=k], &mut self.band[end - k - 1..end]);
            axpy(x, arrow, &mut self.side[row * a..(row + 1) * a]);
            self.right[row] += x * r;
        }
        for (k, &x) in arrow.iter().enumerate() {
            if x != 0.0 {
                axpy(x, &arrow[..=k], &mut self.corner[k * a..=k * a + k]);
                self.right_corner[k] += x * r;
            }
        }
    }

    /// Adds `value` to entry (row, column) of the band, `column ≤ row`.
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.band[row * (self.bandwidth + 1) + self.bandwidth + column - row] += value;
    }

    /// Adds to the right-hand side of row `row` of the band.
    pub(super) fn add_right(&mut self, row: usize, value: f64) {
        self.right[row] += value;
    }

    pub(super) fn right(&self) -> &[f64] {
        &self.right
    }

    pub(super) fn product(&self, x: &[f64]) -> Vec<f64> {
        let (b, wide) = (self.bandwidth, self.bandwidth + 1);
        let mut out = vec![0.0; self.size];
        for i in 0..self.size {
            let lowest = i.saturating_sub(b);
            let row = &self.band[i * wide + lowest + b - i..i * wide + b];
            out[i] += dot(row, &x[lowest..i]) + self.band[i * wide + b] * x[i];
            axpy(x[i], row, &mut out[lowest..i]);
        }
        out
    }

    /// Adds a matrix of the same bandwidth and arrow; its first unknown is unknown `first` of this matrix.
    pub(super) fn add_part(&mut self, first: usize, part: &Self) {
        let wide = self.bandwidth + 1;
        let sum = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        sum(&mut self.band[first * wide..(first + part.size) * wide], &part.band);
        sum(&mut self.side[first * self.arrow..(first + part.size) * self.arrow], &part.side);
        sum(&mut self.corner, &part.corner);
        sum(&mut self.right[first..first + part.size], &part.right);
        sum(&mut self.right_corner, &part.right_corner);
    }

    /// Eliminates the band: `B = L Lᵀ`, `W = L⁻¹A`. If B is not positive definite, the error is the index of the
    /// first dependent unknown.
    pub(super) fn eliminated(&self) -> Result<Eliminated, usize> {
        let (b, wide, a) = (self.bandwidth, self.bandwidth + 1, self.arrow);
        let mut l = self.band.clone();
        let (mut w, mut y) = (self.side.clone(), self.right.clone());
        for i in 0..self.size {
            let lowest = i.saturating_sub(b);
            let (before, own) = l.split_at_mut(i * wide);
            let own = &mut own[..wide];
            let from = lowest + b - i;
            for j in lowest..i {
                let to = j + b - i;
                let other = &before[j * wide + lowest + b - j..j * wide + b];
                own[to] = (own[to] - dot(&own[from..to], other)) / before[j * wide + b];
            }
            let pivot = own[b] - dot(&own[from..b], &own[from..b]);
            // Rounding of a sum of squares of that size.
            if pivot.is_nan() || pivot <= f64::EPSILON * own[b].abs() {
                return Err(i);
            }
            let root = pivot.sqrt();
            own[b] = root;
            let (w_before, w_own) = w.split_at_mut(i * a);
            let w_own = &mut w_own[..a];
            let mut value = y[i];
            for j in lowest..i {
                let share = own[j + b - i];
                if share != 0.0 {
                    axpy(-share, &w_before[j * a..(j + 1) * a], w_own);
                    value -= share * y[j];
                }
            }
            for x in w_own.iter_mut() {
                *x /= root;
            }
            y[i] = value / root;
        }
        let mut schur = self.corner.clone();
        let mut right = self.right_corner.clone();
        for i in 0..self.size {
            let own = &w[i * a..(i + 1) * a];
            for (k, &x) in own.iter().enumerate() {
                axpy(-x, &own[..=k], &mut schur[k * a..=k * a + k]);
            }
            axpy(-y[i], own, &mut right);
        }
        let schur = DMatrix::from_fn(a, a, |row, column| schur[row.max(column) * a + row.min(column)]);
        Ok(Eliminated { size: self.size, bandwidth: b, arrow: a, l, w, y, schur, right })
    }
}

#[derive(Clone, Debug)]
pub(super) struct Eliminated {
    size: usize,
    bandwidth: usize,
    arrow: usize,
    l: Vec<f64>,
    w: Vec<f64>,
    y: Vec<f64>,
    /// `D − AᵀB⁻¹A`, the Schur complement of the band.
    pub(super) schur: DMatrix<f64>,
    /// Right-hand side of the arrow after elimination.
    pub(super) right: Vec<f64>,
}

impl Eliminated {
    /// Unknowns of the band for given unknowns of the arrow: `B⁻¹(b − A x)`.
    pub(super) fn band_solution(&self, arrow: &[f64]) -> Vec<f64> {
        let a = self.arrow;
        let mut x: Vec<f64> = (0..self.size).map(|i| self.y[i] - dot(&self.w[i * a..(i + 1) * a], arrow)).collect();
        self.back(&mut x, 1);
        x
    }

    /// `B⁻¹A`, row-major (size × arrow): sensitivity of the band's unknowns to those of the arrow.
    pub(super) fn shares(&self) -> Vec<f64> {
        let mut v = self.w.clone();
        self.back(&mut v, self.arrow);
        v
    }

    /// `x ← L⁻ᵀx` for `count` right-hand sides.
    fn back(&self, x: &mut [f64], count: usize) {
        let (b, wide) = (self.bandwidth, self.bandwidth + 1);
        for i in (0..self.size).rev() {
            let row = &self.l[i * wide..(i + 1) * wide];
            let (before, own) = x.split_at_mut(i * count);
            let own = &mut own[..count];
            for x in own.iter_mut() {
                *x /= row[b];
            }
            for j in i.saturating_sub(b)..i {
                let share = row[j + b - i];
                if share != 0.0 {
                    axpy(-share, own, &mut before[j * count..(j + 1) * count]);
                }
            }
        }
    }

    /// `2 Σ ln L_ii`, the log-determinant of B.
    pub(super) fn log_determinant(&self) -> f64 {
        let wide = self.bandwidth + 1;
        2.0 * (0..self.size).map(|i| self.l[i * wide + self.bandwidth].ln()).sum::<f64>()
    }

    /// Entries of `B⁻¹` inside the band.
    pub(super) fn inverse(&self) -> InverseBand {
        let (b, wide, size) = (self.bandwidth, self.bandwidth + 1, self.size);
        let mut z = vec![0.0; size * wide];
        let (mut column, mut product) = (vec![0.0; b], vec![0.0; b]);
        for j in (0..size).rev() {
            // Z L = L⁻ᵀ: column j of Z below the diagonal is −Z(later, later) l / L_jj.
            let later = b.min(size - 1 - j);
            let pivot = self.l[j * wide + b];
            for (k, l) in column[..later].iter_mut().enumerate() {
                let row = j + 1 + k;
                *l = self.l[row * wide + j + b - row];
            }
            product[..later].fill(0.0);
            for k in 0..later {
                let row = j + 1 + k;
                let own = &z[row * wide + b - k..=row * wide + b];
                product[k] += dot(own, &column[..=k]);
                let x = column[k];
                axpy(x, &own[..k], &mut product[..k]);
            }
            for k in 0..later {
                let row = j + 1 + k;
                z[row * wide + j + b - row] = -product[k] / pivot;
            }
            let of_later = dot(&column[..later], &product[..later]);
            // Z_jj = (1/L_jj − Σ Z_jk L_kj)/L_jj with Z_jk = −product/L_jj.
            z[j * wide + b] = (1.0 + of_later) / (pivot * pivot);
        }
        InverseBand { bandwidth: b, z }
    }
}

#[derive(Clone, Debug)]
pub(super) struct InverseBand {
    bandwidth: usize,
    z: Vec<f64>,
}

impl InverseBand {
    /// Entry (row, column), at most a bandwidth from the diagonal.
    pub(super) fn entry(&self, row: usize, column: usize) -> f64 {
        let (row, column) = (row.max(column), row.min(column));
        self.z[row * (self.bandwidth + 1) + self.bandwidth + column - row]
    }
}

#[inline]
pub(super) fn axpy(x: f64, from: &[f64], to: &mut [f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += x * from;
    }
}

/// Scalar product in four independent sums.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (left, right) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in left.zip(right) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;
    use nalgebra::DVector;

    /// Random rows against nalgebra's dense Cholesky: agreement to rounding, 1e-9 of entries of order one at a
    /// condition number below 1e4.
    #[test]
    fn banded_arrow_equals_the_dense_matrix() {
        let mut random = Random::new(3);
        for (size, window, arrow) in [(23, 6, 4), (12, 12, 0), (5, 1, 3)] {
            let mut matrix = BandedArrow::new(size, window - 1, arrow);
            let all = size + arrow;
            let (mut dense, mut right) = (DMatrix::<f64>::zeros(all, all), DVector::<f64>::zeros(all));
            for row in 0..10 * size {
                let first = row % (size - window + 1);
                let own: Vec<f64> = (0..window).map(|_| random.normal()).collect();
                let far: Vec<f64> = (0..arrow).map(|_| random.normal()).collect();
                let r = random.normal();
                matrix.add_row(first, &own, &far, r);
                let mut x = DVector::<f64>::zeros(all);
                own.iter().enumerate().for_each(|(k, value)| x[first + k] = *value);
                far.iter().enumerate().for_each(|(k, value)| x[size + k] = *value);
                dense += &x * x.transpose();
                right += &x * r;
            }
            let inverse = dense.clone().cholesky().unwrap().inverse();
            let expected = &inverse * &right;
            let x: Vec<f64> = (0..size).map(|_| random.normal()).collect();
            let product = dense.view((0, 0), (size, size)) * DVector::from_column_slice(&x);
            assert!(matrix.product(&x).iter().zip(&product).all(|(a, b)| (a - b).abs() < 1e-9));
            let found = matrix.eliminated().unwrap();
            let theta = if arrow > 0 {
                let schur = found.schur.clone().cholesky().unwrap();
                let covariance = schur.inverse();
                let expected = inverse.view((size, size), (arrow, arrow)).into_owned();
                assert!((covariance - expected).amax() < 1e-9);
                schur.solve(&DVector::from_column_slice(&found.right)).as_slice().to_vec()
            } else {
                Vec::new()
            };
            let band = found.band_solution(&theta);
            for (k, value) in band.iter().chain(&theta).enumerate() {
                assert!((value - expected[k]).abs() < 1e-9, "{k}");
            }
            let b = dense.view((0, 0), (size, size)).into_owned();
            assert!((found.log_determinant() - b.determinant().ln()).abs() < 1e-8);
            let (own_inverse, near) = (b.clone().cholesky().unwrap().inverse(), found.inverse());
            for i in 0..size {
                for j in i.saturating_sub(window - 1)..=i {
                    assert!((near.entry(i, j) - own_inverse[(i, j)]).abs() < 1e-9);
                }
            }
            let shares = DMatrix::from_row_slice(size, arrow, &found.shares());
            assert!((shares - own_inverse * dense.view((0, size), (size, arrow))).iter().all(|x| x.abs() < 1e-9));
        }
    }

    #[test]
    fn unknowns_without_rows_are_named() {
        let mut matrix = BandedArrow::new(3, 1, 0);
        matrix.add_row(0, &[1.0, 0.5], &[], 0.0);
        matrix.add_row(0, &[0.2, 1.0], &[], 0.0);
        assert_eq!(matrix.eliminated().unwrap_err(), 2);
    }
}
