//! Eigenvalues and eigenvectors of a symmetric matrix, fast at the sizes of information matrices.
//!
//! Householder's reduction to three diagonals and implicit QL steps (Golub and Van Loan, *Matrix Computations*, 2013,
//! sections 8.3.1 and 8.3.3; Bowdler, Martin, Reinsch and Wilkinson, *Numerische Mathematik* 11, 1968, 293), every
//! operation a stream over whole rows.

use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::DMatrix;

/// Widest lanes: rows are padded to a multiple of it.
const WIDE: usize = 8;

/// QL steps for one eigenvalue at most; two are usual.
const STEPS: usize = 60;

/// `A = Σ_k λ_k v_k v_kᵀ` with orthonormal `v_k`, in no order.
pub(crate) struct SymmetricEigen {
    pub(crate) values: Vec<f64>,
    /// The vectors, one after another, each `stride` long with zeros behind its entries.
    vectors: Vec<f64>,
    stride: usize,
}

impl SymmetricEigen {
    /// Of a symmetric matrix, of which the lower triangle counts; none if an entry is not a finite number.
    ///
    /// A matrix twice as large has the same vectors and values twice as large, bit for bit.
    pub(crate) fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let stride = size.next_multiple_of(WIDE);
        let largest = matrix.amax();
        if !largest.is_finite() || matrix.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        // Squares of entries near one neither overflow nor vanish.
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

    /// The smallest and the largest eigenvalue.
    pub(crate) fn extremes(&self) -> (f64, f64) {
        let range = (f64::INFINITY, f64::NEG_INFINITY);
        self.values.iter().fold(range, |(low, high), value| (low.min(*value), high.max(*value)))
    }

    /// `Σ_k w_k v_k v_kᵀ` for the weights of the eigenvalues.
    pub(crate) fn weighted(&self, weights: &[f64]) -> DMatrix<f64> {
        let (size, stride) = (self.values.len(), self.stride);
        let mut out = vec![0.0; size * stride];
        // Far below the last digit of the sum.
        let least = 1e-20 * weights.iter().fold(0.0, |most: f64, weight| most.max(weight.abs()));
        for (vector, weight) in self.vectors.chunks_exact(stride.max(1)).zip(weights) {
            if weight.abs() > least {
                dispatch(Level::detect(), AddSquare { vector, weight: *weight, out: &mut out, size, stride });
            }
        }
        DMatrix::from_fn(size, size, |i, j| out[i.max(j) * stride + i.min(j)])
    }
}

/// The power of two at or below a positive number; 1 for others.
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
            // The lower triangle, and what fills its last register.
            let end = (i + 1).next_multiple_of(WIDE);
            add_times::<T>(&mut row[..end], self.weight * self.vector[i], &self.vector[..end]);
        }
    }
}

/// Takes the matrix in `rows` and leaves the eigenvectors there; gives the eigenvalues.
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
        let (mut diagonal, mut beside) = (vec![0.0; n], vec![0.0; n]);
        // Reflections `1 - b v vᵀ`, one a column: v in the row of the same number, zero up to the diagonal.
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
            // The row is the column: the rest of the matrix is symmetric.
            v[k + 1..].copy_from_slice(&above[k * stride + k + 1..]);
            let from = (k + 1) / WIDE * WIDE;
            let first = core::mem::take(&mut v[k + 1]);
            let tail = dot::<T>(&v[from..], &v[from..]);
            if tail <= 0.0 {
                beside[k] = first;
                v.fill(0.0);
                continue;
            }
            let norm = (first * first + tail).sqrt();
            let head = if first > 0.0 { first + norm } else { first - norm };
            beside[k] = first - head;
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
        // The transpose, so that rotations act on rows.
        for i in 0..n {
            for j in 0..n {
                rows[j * stride + i] = q[i * stride + j];
            }
            for j in n..stride {
                rows[i * stride + j] = 0.0;
            }
        }
        ql::<T>(&mut diagonal, &mut beside, rows, stride)?;
        Some(diagonal)
    }
}

/// `Q = H_0 H_1 ..` of the reflections `1 - b v vᵀ`, from the last; `product` is scratch of one row.
#[inline(always)]
fn product_of_reflections<T: Lane>(reflections: &[f64], factors: &[f64], product: &mut [f64]) -> Vec<f64> {
    let (n, stride) = (factors.len(), product.len());
    let mut q = vec![0.0; n * stride];
    for k in 0..n {
        q[k * stride + k] = 1.0;
    }
    for k in (0..n.saturating_sub(2)).rev().filter(|&k| factors[k] != 0.0) {
        let v = &reflections[k * stride..(k + 1) * stride];
        let from = (k + 1) / WIDE * WIDE;
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

/// Implicit QL steps on the three diagonals until the outer ones vanish; rotations turn the rows of `vectors` too.
#[inline(always)]
fn ql<T: Lane>(diagonal: &mut [f64], beside: &mut [f64], vectors: &mut [f64], stride: usize) -> Option<()> {
    let n = diagonal.len();
    for first in 0..n {
        for step in 0.. {
            // The block from `first` ends where the next entry beside the diagonal is nothing.
            let mut last = first;
            while last + 1 < n {
                let around = diagonal[last].abs() + diagonal[last + 1].abs();
                if beside[last].abs() <= f64::EPSILON * around {
                    break;
                }
                last += 1;
            }
            if last == first {
                break;
            }
            if step == STEPS {
                return None;
            }
            // Wilkinson's shift.
            let half = (diagonal[first + 1] - diagonal[first]) / (2.0 * beside[first]);
            let root = (half * half + 1.0).sqrt();
            let shift = beside[first] / (half + if half < 0.0 { -root } else { root });
            let mut g = diagonal[last] - diagonal[first] + shift;
            let (mut sine, mut cosine, mut moved) = (1.0, 1.0, 0.0);
            let mut whole = true;
            for i in (first..last).rev() {
                let (f, b) = (sine * beside[i], cosine * beside[i]);
                let radius = (f * f + g * g).sqrt();
                beside[i + 1] = radius;
                if radius == 0.0 {
                    // The block has come apart.
                    diagonal[i + 1] -= moved;
                    beside[last] = 0.0;
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
                beside[first] = g;
                beside[last] = 0.0;
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

    /// `V diag(λ) Vᵀ = A`, `Vᵀ V = 1` and the values of a general library; 1e-13 for sums of at most 64 terms, relative
    /// to the largest value.
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

    /// Equal eigenvalues, zeros, blocks, diagonals.
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
        // Backward stability: errors relative to the largest.
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
