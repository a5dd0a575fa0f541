//! Products of dense rows with a vector and the two solutions with a packed triangle, as vector kernels: a third of
//! the time of a Newton step.

use crate::factor::row_start;
use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::DMatrix;

/// Columns that share each load of the vector.
const COLUMNS_PER_BLOCK: usize = 4;

/// Adds `Aᵀ h` to `sum`.
pub(super) fn add_transposed(matrix: &DMatrix<f64>, h: &[f64], sum: &mut [f64]) {
    if !h.is_empty() {
        dispatch(Level::detect(), AddTransposed { matrix: matrix.as_slice(), h, sum });
    }
}

/// Subtracts `A u` from `h`.
pub(super) fn subtract_product(matrix: &DMatrix<f64>, u: &[f64], h: &mut [f64]) {
    if !h.is_empty() {
        dispatch(Level::detect(), SubtractProduct { matrix: matrix.as_slice(), u, h });
    }
}

/// Replaces b by y with `Rᵀ y = b`; R is packed by rows.
pub(super) fn solve_lower(triangle: &[f64], b: &mut [f64]) {
    dispatch(Level::detect(), Lower { triangle, b });
}

/// Replaces y by u with `R u = y`.
pub(super) fn solve_upper(triangle: &[f64], y: &mut [f64]) {
    dispatch(Level::detect(), Upper { triangle, y });
}

struct AddTransposed<'a> {
    matrix: &'a [f64],
    h: &'a [f64],
    sum: &'a mut [f64],
}

impl Kernel for AddTransposed<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let rows = self.h.len();
        let mut columns = self.matrix.chunks_exact(COLUMNS_PER_BLOCK * rows);
        let mut sums = self.sum.chunks_exact_mut(COLUMNS_PER_BLOCK);
        for (columns, sums) in (&mut columns).zip(&mut sums) {
            let found = dots::<T, COLUMNS_PER_BLOCK>(columns, self.h);
            for k in 0..COLUMNS_PER_BLOCK {
                sums[k] += found[k];
            }
        }
        for (column, sum) in columns.remainder().chunks_exact(rows).zip(sums.into_remainder()) {
            let [found] = dots::<T, 1>(column, self.h);
            *sum += found;
        }
    }
}

struct SubtractProduct<'a> {
    matrix: &'a [f64],
    u: &'a [f64],
    h: &'a mut [f64],
}

impl Kernel for SubtractProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let rows = self.h.len();
        let mut columns = self.matrix.chunks_exact(COLUMNS_PER_BLOCK * rows);
        let mut factors = self.u.chunks_exact(COLUMNS_PER_BLOCK);
        for (columns, factors) in (&mut columns).zip(&mut factors) {
            subtract::<T, COLUMNS_PER_BLOCK>(columns, factors, self.h);
        }
        for (column, factor) in columns.remainder().chunks_exact(rows).zip(factors.remainder().chunks_exact(1)) {
            subtract::<T, 1>(column, factor, self.h);
        }
    }
}

struct Lower<'a> {
    triangle: &'a [f64],
    b: &'a mut [f64],
}

impl Kernel for Lower<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let size = self.b.len();
        for k in 0..size {
            let row = &self.triangle[row_start(size, k)..row_start(size, k + 1)];
            let (done, rest) = self.b.split_at_mut(k + 1);
            let y = done[k] / row[0];
            done[k] = y;
            subtract::<T, 1>(&row[1..], &[y], rest);
        }
    }
}

struct Upper<'a> {
    triangle: &'a [f64],
    y: &'a mut [f64],
}

impl Kernel for Upper<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let size = self.y.len();
        for k in (0..size).rev() {
            let row = &self.triangle[row_start(size, k)..row_start(size, k + 1)];
            let (rest, done) = self.y.split_at_mut(k + 1);
            let [sum] = dots::<T, 1>(&row[1..], done);
            rest[k] = (rest[k] - sum) / row[0];
        }
    }
}

/// Inner products of `N` consecutive columns with `h`.
#[inline(always)]
fn dots<T: Lane, const N: usize>(columns: &[f64], h: &[f64]) -> [f64; N] {
    let rows = h.len();
    let whole = rows - rows % T::LANES;
    let mut sums = [T::ZERO; N];
    for at in (0..whole).step_by(T::LANES) {
        let value = T::load(&h[at..]);
        for n in 0..N {
            sums[n] = T::load(&columns[n * rows + at..]).mul_add(value, sums[n]);
        }
    }
    let mut found = [0.0; N];
    for n in 0..N {
        let mut rest = 0.0;
        for at in whole..rows {
            rest += columns[n * rows + at] * h[at];
        }
        found[n] = sums[n].sum() + rest;
    }
    found
}

/// `h -= Σ_n factors[n] columns[n]`.
#[inline(always)]
fn subtract<T: Lane, const N: usize>(columns: &[f64], factors: &[f64], h: &mut [f64]) {
    let rows = h.len();
    let whole = rows - rows % T::LANES;
    let mut lanes = [T::ZERO; N];
    for n in 0..N {
        lanes[n] = T::splat(-factors[n]);
    }
    for at in (0..whole).step_by(T::LANES) {
        let mut value = T::load(&h[at..]);
        for n in 0..N {
            value = T::load(&columns[n * rows + at..]).mul_add(lanes[n], value);
        }
        value.store(&mut h[at..]);
    }
    for at in whole..rows {
        for n in 0..N {
            h[at] -= factors[n] * columns[n * rows + at];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn products_agree_at_every_processor_level() {
        let wave = |i: usize, j: usize| ((i * i * 5 + j * 3 + i * j * j * 2) as f64 * 0.37).sin();
        for (rows, columns) in [(0, 3), (1, 1), (5, 9), (16, 7), (23, 12)] {
            let matrix = DMatrix::from_fn(rows, columns, wave);
            let (h, u) = (DVector::from_fn(rows, |i, _| wave(i, 20)), DVector::from_fn(columns, |i, _| wave(i, 30)));
            for level in Level::available() {
                let (mut sum, mut rest) = (u.clone(), h.clone());
                if rows > 0 {
                    let entries = matrix.as_slice();
                    dispatch(level, AddTransposed { matrix: entries, h: h.as_slice(), sum: sum.as_mut_slice() });
                    dispatch(level, SubtractProduct { matrix: entries, u: u.as_slice(), h: rest.as_mut_slice() });
                }
                // Sums of two dozen products of at most one.
                assert!((sum - (&u + matrix.tr_mul(&h))).amax() < 1e-13, "{rows} {columns}");
                assert!((rest - (&h - &matrix * &u)).amax() < 1e-13, "{rows} {columns}");
            }
        }
    }

    #[test]
    fn both_solutions_satisfy_the_triangle() {
        let size = 21;
        let entry = |i: usize, j: usize| if i == j { 2.0 } else { 0.3 * ((i * 7 + j * j) as f64 * 0.61).sin() };
        let packed: Vec<f64> = (0..size).flat_map(|i| (i..size).map(move |j| entry(i, j))).collect();
        let dense = DMatrix::from_fn(size, size, |i, j| if j < i { 0.0 } else { entry(i, j) });
        let b = DVector::from_fn(size, |i, _| (i as f64).cos());
        for level in Level::available() {
            let (mut y, mut u) = (b.clone(), b.clone());
            dispatch(level, Lower { triangle: &packed, b: y.as_mut_slice() });
            dispatch(level, Upper { triangle: &packed, y: u.as_mut_slice() });
            // Condition number of the triangle (some tens) times rounding, with margin.
            assert!((dense.tr_mul(&y) - &b).amax() < 1e-12 && (&dense * &u - &b).amax() < 1e-12);
        }
    }
}
