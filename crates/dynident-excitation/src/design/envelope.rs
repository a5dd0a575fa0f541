//! Cholesky factorisation of a sparse matrix. Each row is stored from its first nonzero entry; the row of the factor
//! begins at the same entry.
//!
//! George and Liu, *Computer Solution of Large Sparse Positive Definite Systems* (1981), section 4.1. The variables are
//! reversed, because the first parameter of a periodic spline is coupled to the parameters of both ends and would
//! otherwise fill the factor.

use nalgebra::DMatrix;

/// `L` with `L Lᵀ = P A Pᵀ`, where P reverses the order.
pub(super) struct EnvelopeFactor {
    rows: Vec<f64>,
    first: Vec<usize>,
}

impl EnvelopeFactor {
    /// Factors the lower triangle of a matrix; `None` if it is not positive definite.
    pub(super) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let mut rows = vec![0.0; size * size];
        let mut first = Vec::with_capacity(size);
        for i in 0..size {
            let entry = |j: usize| matrix[(size - 1 - j, size - 1 - i)];
            let begin = (0..i).find(|&j| entry(j) != 0.0).unwrap_or(i);
            first.push(begin);
            let (above, own) = rows.split_at_mut(i * size);
            for j in begin..i {
                let from = begin.max(first[j]);
                let row = &above[j * size..(j + 1) * size];
                own[j] = (entry(j) - dot(&own[from..j], &row[from..j])) / row[j];
            }
            let square = entry(i) - dot(&own[begin..i], &own[begin..i]);
            if !(square > 0.0 && square.is_finite()) {
                return None;
            }
            own[i] = square.sqrt();
        }
        Some(Self { rows, first })
    }

    /// `v ← A⁻¹ v`.
    pub(super) fn solve(&self, v: &mut [f64]) {
        let size = self.first.len();
        v.reverse();
        for i in 0..size {
            let (row, first) = (&self.rows[i * size..(i + 1) * size], self.first[i]);
            v[i] = (v[i] - dot(&row[first..i], &v[first..i])) / row[i];
        }
        for i in (0..size).rev() {
            let (row, first) = (&self.rows[i * size..(i + 1) * size], self.first[i]);
            let value = v[i] / row[i];
            v[i] = value;
            for (to, l) in v[first..i].iter_mut().zip(&row[first..i]) {
                *to -= l * value;
            }
        }
        v.reverse();
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;
    use nalgebra::DVector;

    /// Compares with a general library, for dense matrices and for bands whose first variable is coupled to the last
    /// ones.
    #[test]
    fn solves_as_a_library_does() {
        let mut random = Random::new(3);
        for (size, band) in [(1, 9), (9, 9), (30, 3)] {
            let mut matrix = DMatrix::from_fn(size, size, |i, j| {
                if i.abs_diff(j) <= band || (j == 0 && i + 3 > size) { random.normal() } else { 0.0 }
            });
            matrix = (&matrix + matrix.transpose()) + DMatrix::identity(size, size) * 30.0;
            let vector = DVector::from_fn(size, |_, _| random.normal());
            let expected = matrix.clone().cholesky().unwrap().solve(&vector);
            let factor = EnvelopeFactor::new(&matrix).unwrap();
            let mut found = vector.as_slice().to_vec();
            factor.solve(&mut found);
            assert!(found.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-14), "{size}");
            if size == 30 {
                assert!((0..29).all(|row| row - factor.first[row] <= band));
            }
        }
        assert!(EnvelopeFactor::new(&DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])).is_none());
        assert!(EnvelopeFactor::new(&DMatrix::from_element(1, 1, f64::NAN)).is_none());
    }
}
