//! Independent columns of a matrix, from left to right.

use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;

/// Rounding error of an exact zero for sums of several hundred products, with margin.
const ROUNDING_SHARE: f64 = 1e-12;

/// Split of a matrix's columns into independent ones and combinations of earlier independent ones.
#[derive(Clone, Debug, PartialEq)]
pub struct IndependentColumns {
    /// Indices of the columns that are not combinations of earlier columns, ascending.
    pub independent: Vec<usize>,
    /// Indices of the other columns, ascending.
    pub dependent: Vec<usize>,
    /// `regrouping[(b, d)]`: coefficient of independent column `b` in dependent column `d`, so that `A[dependent] =
    /// A[independent] · regrouping`. Shape (independent, dependent).
    pub regrouping: DMatrix<f64>,
    /// Smallest remaining share of a column that was accepted as independent (1 without independent columns).
    pub weakest_independent: f64,
    /// Largest remaining share of a column that was rejected as dependent (0 without dependent columns).
    pub strongest_dependent: f64,
}

/// Splits the columns of `matrix` from left to right. A column is dependent if its part orthogonal to all earlier
/// independent columns is at most `tolerance` times its norm. It is also dependent if it is rounding noise: its norm
/// is below 1e-12 or `tolerance²` of the largest norm.
///
/// Householder reflections that **skip dependent columns without using a row**. The textbook rule (dependent if the
/// diagonal entry of R is small) depends on rounding noise in the used row and can misclassify all later columns.
/// Deterministic; the order of rows changes the result by rounding only. Zeros at the end of columns cost nothing, so
/// a staircase matrix needs far less than cubic time.
pub fn independent_columns(matrix: &DMatrix<f64>, tolerance: f64) -> IndependentColumns {
    split_columns(matrix, tolerance)
}

/// Like [`independent_columns`], but for robot regressors: a column whose norm is below `tolerance` times the largest
/// column norm is also dependent. Such a column is nonzero only because of rounded angles in the robot description
/// (9.81 · 4e-10 for π as 3.141592654).
pub(crate) fn independent_regressor_columns(matrix: &DMatrix<f64>, tolerance: f64) -> IndependentColumns {
    split_above(matrix, tolerance, ROUNDING_SHARE.max(tolerance))
}

/// The columns of a matrix that need not be stored completely.
pub(crate) trait Columns {
    fn rows(&self) -> usize;

    /// Passes all columns to `take`, from left to right; zeros at a column's end may be omitted.
    fn for_each(&self, take: &mut dyn FnMut(&[f64]));
}

impl Columns for DMatrix<f64> {
    fn rows(&self) -> usize {
        self.nrows()
    }

    fn for_each(&self, take: &mut dyn FnMut(&[f64])) {
        for column in self.column_iter() {
            let entries = column.as_slice();
            take(&entries[..entries.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1)]);
        }
    }
}

/// Does [`independent_columns`] for streamed columns, one at a time: applies all earlier reflections, then makes a
/// new one. It stores the reflections without their zeros, the triangle of the independent columns, and the entries
/// of the dependent columns in its rows.
pub(crate) fn split_columns(columns: &impl Columns, tolerance: f64) -> IndependentColumns {
    split_above(columns, tolerance, ROUNDING_SHARE.max(tolerance * tolerance))
}

/// Columns with a norm below `noise` times the largest norm are dependent.
fn split_above(columns: &impl Columns, tolerance: f64, noise: f64) -> IndependentColumns {
    let rows = columns.rows();
    let mut column = Column { entries: DVector::zeros(rows), end: 0 };
    let mut norms = Vec::new();
    columns.for_each(&mut |entries| {
        column.take(entries);
        norms.push(column.from(0).norm());
    });
    let largest = norms.iter().copied().fold(0.0, f64::max);
    // A column of rounding noise would appear independent if compared with its own norm only.
    let noise = noise * largest;
    let (mut independent, mut dependent) = (Vec::new(), Vec::new());
    let (mut weakest_independent, mut strongest_dependent) = (1.0_f64, 0.0_f64);
    // Reflection `k` begins at row `k`; row `k` of the triangle begins at its diagonal.
    let mut reflections: Vec<Reflection> = Vec::new();
    let mut triangle: Vec<Vec<f64>> = Vec::new();
    let mut regrouped: Vec<Vec<f64>> = Vec::new();
    let mut norms = norms.into_iter().enumerate();
    columns.for_each(&mut |entries| {
        let Some((c, norm)) = norms.next() else { return };
        column.take(entries);
        for (row, reflection) in reflections.iter().enumerate() {
            column.reflect(row, reflection);
        }
        let row = independent.len();
        let rest = column.from(row).norm();
        let share = if norm <= noise { 0.0 } else { rest / norm };
        if share <= tolerance {
            strongest_dependent = strongest_dependent.max(share);
            dependent.push(c);
            regrouped.push(column.entries.as_slice()[..row].to_vec());
            return;
        }
        weakest_independent = weakest_independent.min(share);
        independent.push(c);
        let mut v = column.from(row).into_owned();
        v[0] += rest.copysign(v[0]);
        let reflection = Reflection { beta: 2.0 / v.norm_squared(), v };
        column.reflect(row, &reflection);
        reflections.push(reflection);
        triangle.push(Vec::new());
        for (to, entry) in triangle.iter_mut().zip(&column.entries) {
            to.push(*entry);
        }
    });
    let regrouping = solved(&triangle, &regrouped);
    IndependentColumns { independent, dependent, regrouping, weakest_independent, strongest_dependent }
}

/// `1 - beta v vᵀ`, without the zeros at the end of `v`.
struct Reflection {
    beta: f64,
    v: DVector<f64>,
}

/// The current column: zero from row `end` on.
struct Column {
    entries: DVector<f64>,
    end: usize,
}

impl Column {
    fn take(&mut self, entries: &[f64]) {
        let (given, rest) = self.entries.as_mut_slice().split_at_mut(entries.len());
        given.copy_from_slice(entries);
        rest[..self.end.saturating_sub(entries.len())].fill(0.0);
        self.end = entries.len();
    }

    /// The rows from `row` on without zeros at the end, rounded up to a multiple of eight. Sums are taken over groups
    /// of eight, so the result is bit-identical to that over all rows.
    fn from(&self, row: usize) -> DVectorView<'_, f64> {
        let length = self.end.saturating_sub(row).next_multiple_of(8).min(self.entries.len() - row);
        DVectorView::from_slice(&self.entries.as_slice()[row..], length)
    }

    fn reflect(&mut self, row: usize, Reflection { beta, v }: &Reflection) {
        let mut target = self.entries.rows_mut(row, v.len());
        let w = beta * v.dot(&target);
        target.axpy(-w, v, 1.0);
        self.end = self.end.max(row + v.len());
    }
}

const COLUMNS_PER_BLOCK: usize = 32;

/// Number of products from which multithreading is faster (some milliseconds of work).
const MIN_PRODUCTS_FOR_THREADS: usize = 20_000_000;

/// Regrouping by back-substitution with the triangle of the independent columns. Each dependent column has entries for
/// earlier independent ones. Groups of columns are independent, so the number of threads does not change the result.
fn solved(triangle: &[Vec<f64>], dependent: &[Vec<f64>]) -> DMatrix<f64> {
    let (level, rank) = (Level::detect(), triangle.len());
    let mut regrouping = DMatrix::zeros(rank, dependent.len());
    let places = regrouping.as_mut_slice().chunks_mut((rank * COLUMNS_PER_BLOCK).max(1));
    let groups = dependent.chunks(COLUMNS_PER_BLOCK).zip(places);
    let solve = |(columns, places): (&[Vec<f64>], &mut [f64])| {
        let solved = dispatch(level, BackSubstitution { triangle, columns });
        for (k, (column, to)) in columns.iter().zip(places.chunks_mut(rank)).enumerate() {
            for (to, row) in to.iter_mut().zip(&solved[..column.len()]) {
                *to = row[k];
            }
        }
    };
    let products: usize = dependent.iter().map(|column| column.len() * column.len() / 2).sum();
    if products < MIN_PRODUCTS_FOR_THREADS {
        groups.for_each(solve);
    } else {
        groups.collect::<Vec<_>>().into_par_iter().for_each(solve);
    }
    regrouping
}

struct BackSubstitution<'a> {
    triangle: &'a [Vec<f64>],
    columns: &'a [Vec<f64>],
}

impl Kernel for BackSubstitution<'_> {
    type Output = Vec<[f64; COLUMNS_PER_BLOCK]>;

    /// The loops over columns vectorise; the sums of each column keep their order.
    #[inline(always)]
    fn run<T: Lane>(self) -> Self::Output {
        let rank = self.columns.iter().map(Vec::len).max().unwrap_or(0);
        let mut x = vec![[0.0; COLUMNS_PER_BLOCK]; rank];
        for (k, column) in self.columns.iter().enumerate() {
            for (row, entry) in x.iter_mut().zip(column) {
                row[k] = *entry;
            }
        }
        for b in (0..rank).rev() {
            let (upper, lower) = x.split_at_mut(b + 1);
            let row = &self.triangle[b];
            let mut sum = upper[b];
            for (r, solved) in row[1..].iter().zip(&*lower) {
                for (sum, x) in sum.iter_mut().zip(solved) {
                    *sum -= r * x;
                }
            }
            upper[b] = sum.map(|sum| sum / row[0]);
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::{IndependentColumns, MIN_PRODUCTS_FOR_THREADS, ROUNDING_SHARE, independent_columns, solved};
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    #[test]
    fn threads_of_the_pool_change_no_bit() {
        let number = |a: usize, b: usize| (1.3 * a as f64 + 0.7 * (a * b) as f64).sin();
        let rank = 400;
        let triangle: Vec<Vec<f64>> = (0..rank)
            .map(|row| (row..rank).map(|k| if k == row { 9.0 } else { 0.1 * number(row, k) }).collect())
            .collect();
        let dependent: Vec<Vec<f64>> = (0..260).map(|c| (0..rank).map(|row| number(c, row)).collect()).collect();
        assert!(dependent.len() * rank * rank / 2 > MIN_PRODUCTS_FOR_THREADS);
        let of = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| solved(&triangle, &dependent))
        };
        assert_eq!(of(1), of(3));
    }

    #[test]
    fn dependent_columns_use_no_row() {
        // Columns 2 and 4 depend on earlier ones; the textbook rule would lose column 3 or 5 here.
        let a = DMatrix::from_fn(12, 4, |i, j| ((i * 7 + j * 5 + i * i * (j + 1)) % 11) as f64 - 5.0);
        let mut m = DMatrix::zeros(12, 6);
        for (to, from) in [(0, 0), (1, 1), (3, 2), (5, 3)] {
            m.set_column(to, &a.column(from));
        }
        m.set_column(2, &(a.column(0) * 2.0 - a.column(1)));
        m.set_column(4, &(a.column(2) * 0.5));
        let split = independent_columns(&m, 1e-10);
        assert_eq!(split.independent, [0, 1, 3, 5]);
        assert_eq!(split.dependent, [2, 4]);
        assert!((split.regrouping[(0, 0)] - 2.0).abs() < 1e-12 && (split.regrouping[(1, 0)] + 1.0).abs() < 1e-12);
        assert!((split.regrouping[(2, 1)] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn columns_of_rounding_noise_are_dependent() {
        let a = DMatrix::from_fn(8, 3, |i, j| {
            if j == 1 {
                1e-13 * ((i * 5 % 7) as f64 - 3.0)
            } else {
                ((i * 7 + j * 5 + i * i * (j + 1)) % 11) as f64 - 5.0
            }
        });
        let split = independent_columns(&a, 1e-9);
        assert_eq!(split.independent, [0, 2]);
        assert!(split.strongest_dependent < 1e-12 && split.weakest_independent > 0.1);
    }

    /// Oracle: the split with the full matrix in memory, every reflection over all rows and columns.
    fn split_in_full(matrix: &DMatrix<f64>, tolerance: f64) -> IndependentColumns {
        let (rows, columns) = matrix.shape();
        let mut r = matrix.clone();
        let norms: Vec<f64> = (0..columns).map(|c| matrix.column(c).norm()).collect();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let (mut independent, mut dependent): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
        let (mut weakest_independent, mut strongest_dependent) = (1.0_f64, 0.0_f64);
        for c in 0..columns {
            let row = independent.len();
            let rest = if row < rows { r.view((row, c), (rows - row, 1)).norm() } else { 0.0 };
            let noise = norms[c] <= ROUNDING_SHARE.max(tolerance * tolerance) * largest;
            let share = if noise { 0.0 } else { rest / norms[c] };
            if share <= tolerance {
                strongest_dependent = strongest_dependent.max(share);
                dependent.push(c);
                continue;
            }
            weakest_independent = weakest_independent.min(share);
            independent.push(c);
            let mut v: DVector<f64> = r.view((row, c), (rows - row, 1)).column(0).into_owned();
            v[0] += rest.copysign(v[0]);
            let beta = 2.0 / v.norm_squared();
            for k in c..columns {
                let mut target = r.view_mut((row, k), (rows - row, 1));
                let w = beta * v.dot(&target.column(0));
                target.column_mut(0).axpy(-w, &v, 1.0);
            }
        }
        let mut regrouping = DMatrix::zeros(independent.len(), dependent.len());
        for (d, &column) in dependent.iter().enumerate() {
            for b in (0..independent.partition_point(|&earlier| earlier < column)).rev() {
                let mut sum = r[(b, column)];
                for k in b + 1..independent.len() {
                    sum -= r[(b, independent[k])] * regrouping[(k, d)];
                }
                regrouping[(b, d)] = sum / r[(b, independent[b])];
            }
        }
        IndependentColumns { independent, dependent, regrouping, weakest_independent, strongest_dependent }
    }

    proptest! {
        /// Skipping zeros must not change any bit, because results in files are compared byte by byte.
        #[test]
        fn skipped_zeros_change_no_bit(
            rows in 1..40_usize,
            columns in 1..90_usize,
            slope in 0.0..2.0_f64,
            values in prop::collection::vec(-3.0..3.0_f64, 64),
        ) {
            // A staircase of some slope, with columns that are sums of the two before and columns with zeros inside.
            let mut matrix = DMatrix::from_fn(rows, columns, |i, j| {
                let stair = (i as f64) <= slope * j as f64 + 2.0;
                if stair && (i + j) % 7 > 0 { values[(i * i + 5 * i * j + 11 * j) % 64] } else { 0.0 }
            });
            for j in (4..columns).step_by(4) {
                let sum = matrix.column(j - 1) - matrix.column(j - 2) * 0.3;
                matrix.set_column(j, &sum);
            }
            prop_assert_eq!(independent_columns(&matrix, 1e-9), split_in_full(&matrix, 1e-9));
        }

        #[test]
        fn dependent_columns_are_rebuilt(values in prop::collection::vec(-3.0..3.0_f64, 60), mix in prop::collection::vec(-2..3_i32, 12)) {
            // 6 independent random columns and 3 combinations of the first four.
            let base = DMatrix::from_column_slice(10, 6, &values);
            let mixing = DMatrix::from_fn(6, 3, |i, j| if i < 4 { f64::from(mix[4 * j + i]) } else { 0.0 });
            let mut all = base.clone().resize_horizontally(9, 0.0);
            all.columns_mut(6, 3).copy_from(&(&base * &mixing));
            let split = independent_columns(&all, 1e-9);
            let pick = |indices: &[usize]| DMatrix::from_fn(10, indices.len(), |i, j| all[(i, indices[j])]);
            let rebuilt = pick(&split.independent) * &split.regrouping;
            prop_assert!((rebuilt - pick(&split.dependent)).amax() < 1e-7);
            prop_assert!(split.independent.len() <= 6);
        }
    }
}
