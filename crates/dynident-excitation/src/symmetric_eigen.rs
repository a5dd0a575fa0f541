//! Fast eigenvalues and eigenvectors of a symmetric matrix of the size of information matrices.
//!
//! Householder tridiagonalisation and implicit QL steps (Golub and Van Loan, *Matrix Computations*, 2013, sections
//! 8.3.1 and 8.3.3; Bowdler, Martin, Reinsch and Wilkinson, *Numerische Mathematik* 11, 1968, 293). Every operation
//! streams over whole rows.

use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::DMatrix;

/// Width of the widest SIMD register; rows are padded to a multiple of it.
const LANE_WIDTH: usize = 8;

/// Maximum number of QL steps for one eigenvalue; two are usual.
const MAX_QL_STEPS: usize = 60;

/// `A = Σ_k λ_k v_k v_kᵀ` with orthonormal `v_k`, unordered.
pub(crate) struct SymmetricEigen {
    pub(crate) values: Vec<f64>,
    /// Eigenvectors one after another, each `stride` long, padded with zeros.
    vectors: Vec<f64>,
    stride: usize,
}

impl SymmetricEigen {
    /// Decomposes the lower triangle of a symmetric matrix; `None` if an entry is not finite.
    ///
    /// A matrix twice as large has bit-identical vectors, and values twice as large.
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let stride = size.next_multiple_of(LANE_WIDTH);
        let largest = matrix.amax();
        if !largest.is_finite() || matrix.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        // Scaled so that squares of entries neither overflow nor underflow.
        let unit = power_of_two_near(largest);
        let mut rows = vec![0.0; size * stride];
        for i in 0..size {
            for j in 0..size {
                rows[i * stride + j] = matrix[(i.max(j), i.min(j))] / unit;
            }
        }
        let kernel = Decompose { rows: &mut rows, size, stride };
        let mut values = dispatch(Level::detect(), kernel)?;
        for value in &mut values {
            *value *= unit;
        }
        Some(Self { values, vectors: rows, stride })
    }

    pub(crate) fn extremes(&self) -> (f64, f64) {
        let range = (f64::INFINITY, f64::NEG_INFINITY);
        self.values.iter().fold(range, |(low, high), value| (low.min(*value), high.max(*value)))
    }

    /// `Σ_k w_k v_k v_kᵀ` with one weight per eigenvalue.
    pub(crate) fn weighted(&self, weights: &[f64]) -> DMatrix<f64> {
        let (size, stride) = (self.values.len(), self.stride);
        let mut out = vec![0.0; size * stride];
        // Weights below this are far below the last digit of the sum.
        let least = 1e-20 * weights.iter().fold(0.0, |most: f64, weight| most.max(weight.abs()));
        for (vector, weight) in self.vectors.chunks_exact(stride.max(1)).zip(weights) {
            if weight.abs() > least {
                dispatch(Level::detect(), AddSquare { vector, weight: *weight, out: &mut out, size, stride });
            }
        }
        DMatrix::from_fn(size, size, |i, j| out[i.max(j) * stride + i.min(j)])
    }
}

/// Largest power of two that does not exceed a positive number; 1 for other numbers.
fn power_of_two_near(number: f64) -> f64 {
    if number.is_normal() && number > 0.0 { f64::from_bits(number.to_bits() & (0x7ff << 52)) } else { 1.0 }
}

/// `to += factor · from`.
#[inline(always)]
fn add_times<T: Lane>(to: &mut [f64], factor: f64, from: &[f64]) {
    let factor = T::splat(factor);
    for (to, from) in to.chunks_exact_mut(T::LANES).zip(from.chunks_exact(T::LANES)) {
        factor.mul_add(T::load(from), T::load(to)).store(to);
    }
}

#[inline(always)]
fn dot<T: Lane>(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = T::ZERO;
    for (a, b) in a.chunks_exact(T::LANES).zip(b.chunks_exact(T::LANES)) {
        sum = T::load(a).mul_add(T::load(b), sum);
    }
    sum.sum()
}

struct AddSquare<'a> {
    vector: &'a [f64],
    weight: f64,
    out: &'a mut [f64],
    size: usize,
    stride: usize,
}

impl Kernel for AddSquare<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        for (i, row) in self.out.chunks_exact_mut(self.stride).enumerate().take(self.size) {
            let end = (i + 1).next_multiple_of(LANE_WIDTH);
            add_times::<T>(&mut row[..end], self.weight * self.vector[i], &self.vector[..end]);
        }
    }
}

/// Replaces the matrix in `rows` by the eigenvectors and returns the eigenvalues.
struct Decompose<'a> {
    rows: &'a mut [f64],
    size: usize,
    stride: usize,
}

impl Kernel for Decompose<'_> {
    type Output = Option<Vec<f64>>;
    #[inline(always)]
    fn run<T: Lane>(self) -> Option<Vec<f64>> {
        let Self { rows, size: n, stride } = self;
        let (mut diagonal, mut off_diagonal) = (vec![0.0; n], vec![0.0; n]);
        // Reflections `1 - b v vᵀ`, one per column: v is stored in the row with the same index and is zero up to the
        // diagonal.
        let mut reflections = vec![0.0; n * stride];
        let mut factors = vec![0.0; n];
        let mut product = vec![0.0; stride];
        for k in 0..n {
            diagonal[k] = rows[k * stride + k];
            if k + 1 == n {
                break;
            }
            let (above, below) = rows.split_at_mut((k + 1) * stride);
            let v = &mut reflections[k * stride..(k + 1) * stride];
            // The matrix is symmetric, so the row equals the column.
            v[k + 1..].copy_from_slice(&above[k * stride + k + 1..]);
            let from = (k + 1) / LANE_WIDTH * LANE_WIDTH;
            let first = core::mem::take(&mut v[k + 1]);
            let tail = dot::<T>(&v[from..], &v[from..]);
            if tail <= 0.0 {
                off_diagonal[k] = first;
                v.fill(0.0);
                continue;
            }
            let norm = (first * first + tail).sqrt();
            let head = if first > 0.0 { first + norm } else { first - norm };
            off_diagonal[k] = first - head;
            v[k + 1] = head;
            let factor = 2.0 / (head * head + tail);
            factors[k] = factor;
            // w = b A v - (b² vᵀ A v / 2) v, and A -= v wᵀ + w vᵀ.
            product.fill(0.0);
            for (row, v_i) in below.chunks_exact(stride).zip(&v[k + 1..]) {
                add_times::<T>(&mut product[from..], factor * v_i, &row[from..]);
            }
            for p in &mut product[from..=k] {
                *p = 0.0;
            }
            let share = -0.5 * factor * dot::<T>(&product[from..], &v[from..]);
            add_times::<T>(&mut product[from..], share, &v[from..]);
            for (i, row) in below.chunks_exact_mut(stride).enumerate() {
                let (v_i, w_i) = (T::splat(v[k + 1 + i]), T::splat(product[k + 1 + i]));
                let parts = row[from..].chunks_exact_mut(T::LANES).zip(v[from..].chunks_exact(T::LANES));
                for ((to, v), w) in parts.zip(product[from..].chunks_exact(T::LANES)) {
                    let less = v_i.neg_mul_add(T::load(w), T::load(to));
                    w_i.neg_mul_add(T::load(v), less).store(to);
                }
            }
        }
        let q = product_of_reflections::<T>(&reflections, &factors, &mut product);
        for i in 0..n {
            for j in 0..n {
                rows[j * stride + i] = q[i * stride + j];
            }
            for j in n..stride {
                rows[i * stride + j] = 0.0;
            }
        }
        ql::<T>(&mut diagonal, &mut off_diagonal, rows, stride)?;
        Some(diagonal)
    }
}

/// Computes `Q = H_0 H_1 ..` of the reflections `1 - b v vᵀ`, starting with the last; `product` is scratch memory for
/// one row.
#[inline(always)]
fn product_of_reflections<T: Lane>(reflections: &[f64], factors: &[f64], product: &mut [f64]) -> Vec<f64> {
    let (n, stride) = (factors.len(), product.len());
    let mut q = vec![0.0; n * stride];
    for k in 0..n {
        q[k * stride + k] = 1.0;
    }
    for k in (0..n.saturating_sub(2)).rev().filter(|&k| factors[k] != 0.0) {
        let v = &reflections[k * stride..(k + 1) * stride];
        let from = (k + 1) / LANE_WIDTH * LANE_WIDTH;
        product.fill(0.0);
        for (row, v_i) in q[(k + 1) * stride..].chunks_exact(stride).zip(&v[k + 1..]) {
            add_times::<T>(&mut product[from..], *v_i, &row[from..]);
        }
        for (row, v_i) in q[(k + 1) * stride..].chunks_exact_mut(stride).zip(&v[k + 1..]) {
            add_times::<T>(&mut row[from..], -factors[k] * v_i, &product[from..]);
        }
    }
    q
}

/// Implicit QL steps on the tridiagonal matrix until the off-diagonal entries vanish; the rows of `vectors` are
/// rotated, too.
#[inline(always)]
fn ql<T: Lane>(diagonal: &mut [f64], off_diagonal: &mut [f64], vectors: &mut [f64], stride: usize) -> Option<()> {
    let n = diagonal.len();
    for first in 0..n {
        for step in 0.. {
            // The block that begins at `first` ends where the next off-diagonal entry is negligible.
            let mut last = first;
            while last + 1 < n {
                let around = diagonal[last].abs() + diagonal[last + 1].abs();
                if off_diagonal[last].abs() <= f64::EPSILON * around {
                    break;
                }
                last += 1;
            }
            if last == first {
                break;
            }
            if step == MAX_QL_STEPS {
                return None;
            }
            // Wilkinson's shift.
            let half = (diagonal[first + 1] - diagonal[first]) / (2.0 * off_diagonal[first]);
            let root = (half * half + 1.0).sqrt();
            let shift = off_diagonal[first] / (half + if half < 0.0 { -root } else { root });
            let mut g = diagonal[last] - diagonal[first] + shift;
            let (mut sine, mut cosine, mut moved) = (1.0, 1.0, 0.0);
            let mut whole = true;
            for i in (first..last).rev() {
                let (f, b) = (sine * off_diagonal[i], cosine * off_diagonal[i]);
                let radius = (f * f + g * g).sqrt();
                off_diagonal[i + 1] = radius;
                if radius == 0.0 {
                    diagonal[i + 1] -= moved;
                    off_diagonal[last] = 0.0;
                    whole = false;
                    break;
                }
                let inverse = 1.0 / radius;
                (sine, cosine) = (f * inverse, g * inverse);
                g = diagonal[i + 1] - moved;
                let turned = (diagonal[i] - g) * sine + 2.0 * cosine * b;
                moved = sine * turned;
                diagonal[i + 1] = g + moved;
                g = cosine * turned - b;
                let (one, other) = vectors[i * stride..(i + 2) * stride].split_at_mut(stride);
                let (s, c) = (T::splat(sine), T::splat(cosine));
                for (one, other) in one.chunks_exact_mut(T::LANES).zip(other.chunks_exact_mut(T::LANES)) {
                    let (x, y) = (T::load(one), T::load(other));
                    s.mul_add(x, c * y).store(other);
                    s.neg_mul_add(y, c * x).store(one);
                }
            }
            if whole {
                diagonal[first] -= moved;
                off_diagonal[first] = g;
                off_diagonal[last] = 0.0;
            }
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    fn symmetric(size: usize, random: &mut Random) -> DMatrix<f64> {
        let root = DMatrix::from_fn(size, size, |_, _| random.normal());
        &root + root.transpose()
    }

    /// Compares with a general library; tolerance 1e-13 relative to the largest value, for sums of at most 64 terms.
    #[test]
    fn agrees_with_a_library_and_with_itself() {
        let mut random = Random::new(5);
        for size in [1, 2, 3, 7, 8, 9, 36, 43, 64] {
            let matrix = symmetric(size, &mut random) * 1e3;
            let eigen = SymmetricEigen::new(&matrix).unwrap();
            let most = eigen.values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            assert!((eigen.weighted(&eigen.values) - &matrix).amax() < 1e-13 * most, "{size}");
            assert!((eigen.weighted(&vec![1.0; size]) - DMatrix::identity(size, size)).amax() < 1e-13, "{size}");
            let mut expected: Vec<f64> = matrix.symmetric_eigenvalues().iter().copied().collect();
            let mut values = eigen.values.clone();
            expected.sort_by(f64::total_cmp);
            values.sort_by(f64::total_cmp);
            for (value, expected) in values.iter().zip(&expected) {
                assert!((value - expected).abs() < 1e-13 * most, "{size}: {value} {expected}");
            }
        }
    }

    /// Equal eigenvalues, zeros, blocks, diagonal matrices.
    #[test]
    fn degenerate_matrices_have_their_values() {
        let mut random = Random::new(6);
        let basis = SymmetricEigen::new(&symmetric(20, &mut random)).unwrap();
        let mut known = vec![2.0; 20];
        known[..5].fill(0.0);
        known[5..8].fill(1e-9);
        let matrix = basis.weighted(&known);
        let mut values = SymmetricEigen::new(&matrix).unwrap().values;
        values.sort_by(f64::total_cmp);
        known.sort_by(f64::total_cmp);
        assert!(values.iter().zip(&known).all(|(value, known)| (value - known).abs() < 1e-13), "{values:?}");
        for matrix in [DMatrix::zeros(6, 6), DMatrix::identity(6, 6), DMatrix::from_element(6, 6, 1.0)] {
            let eigen = SymmetricEigen::new(&matrix).unwrap();
            assert!((eigen.weighted(&eigen.values) - &matrix).amax() < 1e-14);
        }
        assert!(SymmetricEigen::new(&DMatrix::from_element(2, 2, f64::NAN)).is_none());
        assert!(SymmetricEigen::new(&DMatrix::zeros(0, 0)).unwrap().values.is_empty());
    }

    #[test]
    fn powers_of_two_factor_out() {
        let matrix = symmetric(13, &mut Random::new(7));
        let one = SymmetricEigen::new(&matrix).unwrap();
        for factor in [2.0_f64.powi(-300), 0.25, 2.0_f64.powi(200)] {
            let other = SymmetricEigen::new(&(&matrix * factor)).unwrap();
            assert!(one.values.iter().zip(&other.values).all(|(one, other)| one * factor == *other));
            assert_eq!(one.vectors, other.vectors);
        }
    }
}
