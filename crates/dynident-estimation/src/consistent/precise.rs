//! Variables with twice the digits: an unevaluated sum of two vectors.
//!
//! Data rows of 1e4 times variables of 1e7 leave residuals of one: with the sixteen digits of a double the gradient
//! could not be made smaller than rounding leaves it, and with it the certificate. Sums and products without loss:
//! Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26 (2005) 1955, algorithms 3.1, 3.3 and 5.3.

use nalgebra::{DMatrix, DVector};

#[derive(Clone, Debug)]
pub(super) struct Precise {
    /// The nearest doubles.
    pub(super) high: DVector<f64>,
    /// What they leave.
    low: DVector<f64>,
}

/// `a + b` and what rounding took from it.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The leading half of a double's digits, and the rest.
fn split(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

impl Precise {
    pub(super) fn new(high: DVector<f64>) -> Self {
        let low = DVector::zeros(high.len());
        Self { high, low }
    }

    /// Adds a vector.
    pub(super) fn add(&mut self, change: &DVector<f64>) {
        for ((high, low), change) in self.high.iter_mut().zip(&mut self.low).zip(change) {
            let (sum, error) = two_sum(*high, *change);
            (*high, *low) = two_sum(sum, error + *low);
        }
    }

    /// `b − A x`, as if computed with twice the digits.
    pub(super) fn rest(&self, matrix: &DMatrix<f64>, target: &DVector<f64>) -> DVector<f64> {
        let mut sums = target.clone();
        let mut errors = DVector::zeros(target.len());
        for (column, (&high, &low)) in matrix.column_iter().zip(self.high.iter().zip(&self.low)) {
            let (x1, x2) = split(-high);
            for ((&a, sum), error) in column.iter().zip(&mut sums).zip(&mut errors) {
                let product = -a * high;
                let (a1, a2) = split(a);
                let lost = a2 * x2 - (((product - a1 * x1) - a2 * x1) - a1 * x2);
                let (next, rounding) = two_sum(*sum, product);
                *sum = next;
                *error += (lost + rounding) - a * low;
            }
        }
        sums + errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cancels_keeps_its_digits() {
        // 1e8 (1e8 + 1e-9) − 1e16 = 0.1, of which a double keeps nothing: 1e8 + 1e-9 is 1e8.
        let mut x = Precise::new(DVector::from_element(1, 1.0e8));
        x.add(&DVector::from_element(1, 1.0e-9));
        assert_eq!(x.high[0], 1.0e8);
        let rest = x.rest(&DMatrix::from_element(1, 1, 1.0e8), &DVector::from_element(1, 1.0e16));
        assert!((rest[0] + 0.1).abs() < 1e-15);
        // A product that rounding would change: (1 + 2⁻³⁰)² − 1 − 2⁻²⁹ = 2⁻⁶⁰.
        let odd = 1.0 + (2.0_f64).powi(-30);
        let target = DVector::from_element(1, 1.0 + (2.0_f64).powi(-29));
        let rest = Precise::new(DVector::from_element(1, odd)).rest(&DMatrix::from_element(1, 1, odd), &target);
        assert_eq!(rest[0], -(2.0_f64).powi(-60));
    }
}
