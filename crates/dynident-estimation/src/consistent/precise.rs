//! Variables with twice the digits: an unevaluated sum of two vectors.
//!
//! Data rows of 1e4 times variables of 1e7 have residuals of one. In double precision rounding would limit the
//! gradient and the certificate. Error-free sums and products: Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26 (2005)
//! 1955, algorithms 3.1, 3.3 and 5.3.

use dynident_lanes::{Kernel, Lane, Level, dispatch};
use nalgebra::{DMatrix, DVector};
use std::sync::OnceLock;

#[derive(Clone, Debug)]
pub(super) struct Precise {
    pub(super) high: DVector<f64>,
    low: DVector<f64>,
    /// Cached residual of a program's data at this point.
    data_rest: OnceLock<DVector<f64>>,
}

/// `a + b` and its rounding error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// Leading half of a double's digits, and the remainder.
#[inline(always)]
fn split<T: Lane>(a: T) -> (T, T) {
    let scaled = T::splat(134_217_729.0) * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

impl Precise {
    pub(super) fn new(high: DVector<f64>) -> Self {
        let low = DVector::zeros(high.len());
        Self { high, low, data_rest: OnceLock::new() }
    }

    /// The same point without the cache, for another program.
    pub(super) fn of_another(&self) -> Self {
        Self { high: self.high.clone(), low: self.low.clone(), data_rest: OnceLock::new() }
    }

    pub(super) fn add(&mut self, change: &DVector<f64>) {
        self.data_rest.take();
        for ((high, low), change) in self.high.iter_mut().zip(&mut self.low).zip(change) {
            let (sum, error) = two_sum(*high, *change);
            (*high, *low) = two_sum(sum, error + *low);
        }
    }

    /// Cached [`rest`](Self::rest) of the data of the point's program.
    pub(super) fn data_rest(&self, data: &DMatrix<f64>, target: &DVector<f64>) -> &DVector<f64> {
        self.data_rest.get_or_init(|| self.rest(data, target))
    }

    /// `b − A x` with twice the digits; bit-identical at every processor level.
    fn rest(&self, matrix: &DMatrix<f64>, target: &DVector<f64>) -> DVector<f64> {
        let mut out = target.clone();
        let (high, low) = (self.high.as_slice(), self.low.as_slice());
        let rows = target.len();
        dispatch(Level::detect(), Rest { matrix: matrix.as_slice(), rows, high, low, out: out.as_mut_slice() });
        out
    }
}

struct Rest<'a> {
    /// Column by column.
    matrix: &'a [f64],
    rows: usize,
    high: &'a [f64],
    low: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Rest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { matrix, rows, high, low, out } = self;
        let mut from = 0;
        while from < rows {
            // At the end there may be fewer rows than lanes; the extra lanes are not written.
            let count = T::LANES.min(rows - from);
            let entries = |column: usize, buffer: &mut [f64; 8]| -> T {
                let values = &matrix[column * rows + from..][..count];
                if count == T::LANES {
                    return T::load(values);
                }
                buffer[..count].copy_from_slice(values);
                T::load(&buffer[..])
            };
            let mut buffer = [0.0; 8];
            let mut last = [0.0; 8];
            last[..count].copy_from_slice(&out[from..from + count]);
            let (mut sum, mut error) = (T::load(&last), T::splat(0.0));
            for (column, (&high, &low)) in high.iter().zip(low).enumerate() {
                let a = entries(column, &mut buffer);
                let x = T::splat(-high);
                let ((x1, x2), (a1, a2)) = (split(x), split(a));
                let product = a * x;
                let lost = a2 * x2 - (((product - a1 * x1) - a2 * x1) - a1 * x2);
                // Rounding error of the sum, as in `two_sum`.
                let next = sum + product;
                let part = next - sum;
                let rounding = (sum - (next - part)) + (product - part);
                sum = next;
                error += (lost + rounding) - a * T::splat(low);
            }
            (sum + error).store(&mut last);
            out[from..from + count].copy_from_slice(&last[..count]);
            from += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Row by row in plain doubles.
    fn plainly(x: &Precise, matrix: &DMatrix<f64>, target: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(target.len(), |row, _| {
            let (mut sum, mut error) = (target[row], 0.0);
            for column in 0..matrix.ncols() {
                let (a, high) = (matrix[(row, column)], -x.high[column]);
                let product = a * high;
                // Error of a product, by fused multiply-add.
                let lost = a.mul_add(high, -product);
                let (next, rounding) = two_sum(sum, product);
                sum = next;
                error += (lost + rounding) - a * x.low[column];
            }
            sum + error
        })
    }

    #[test]
    fn rows_are_bit_identical_at_every_level() {
        for rows in [1, 3, 8, 13] {
            let wave = |i: usize, j: usize| ((i * 7 + j * j * 3) as f64 * 0.61).sin() * 10.0_f64.powi((i % 5) as i32);
            let (matrix, target) = (DMatrix::from_fn(rows, 9, wave), DVector::from_fn(rows, |i, _| wave(i, 11)));
            let mut x = Precise::new(DVector::from_fn(9, |i, _| 1.0e6 * wave(i, 2)));
            x.add(&DVector::from_fn(9, |i, _| 1.0e-6 * wave(i, 5)));
            let expected = plainly(&x, &matrix, &target);
            for level in Level::available() {
                let mut out = target.clone();
                let kernel = Rest {
                    matrix: matrix.as_slice(),
                    rows,
                    high: x.high.as_slice(),
                    low: x.low.as_slice(),
                    out: out.as_mut_slice(),
                };
                dispatch(level, kernel);
                assert_eq!(out, expected, "{rows} rows, {}", level.name());
            }
        }
    }

    #[test]
    fn cancelling_terms_keep_their_digits() {
        // 1e8 (1e8 + 1e-9) − 1e16 = 0.1; in double precision 1e8 + 1e-9 is 1e8.
        let mut x = Precise::new(DVector::from_element(1, 1.0e8));
        x.add(&DVector::from_element(1, 1.0e-9));
        assert_eq!(x.high[0], 1.0e8);
        let rest = x.rest(&DMatrix::from_element(1, 1, 1.0e8), &DVector::from_element(1, 1.0e16));
        assert!((rest[0] + 0.1).abs() < 1e-15);
        // A product with rounding: (1 + 2⁻³⁰)² − 1 − 2⁻²⁹ = 2⁻⁶⁰.
        let odd = 1.0 + (2.0_f64).powi(-30);
        let target = DVector::from_element(1, 1.0 + (2.0_f64).powi(-29));
        let rest = Precise::new(DVector::from_element(1, odd)).rest(&DMatrix::from_element(1, 1, odd), &target);
        assert_eq!(rest[0], -(2.0_f64).powi(-60));
    }
}
