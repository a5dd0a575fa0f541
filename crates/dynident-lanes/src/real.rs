//! The scalar of friction laws: arithmetic and functions of real numbers.

use crate::scalar::Scalar;

/// A [`Scalar`] with functions of real numbers.
///
/// A law `f(q̇)` written over `Real` gives its value for `f64`, a column of samples for lanes
/// ([`map_all`](crate::map_all)), its slope for [`Dual`](crate::Dual) and generated code for symbols.
pub trait Real: Scalar {
    /// `self / divisor`.
    fn over(self, divisor: Self) -> Self;

    /// Magnitude.
    fn abs(self) -> Self;

    /// Smaller value; `other` if one of them is NaN.
    fn min(self, other: Self) -> Self;

    /// Larger value; `other` if one of them is NaN.
    fn max(self, other: Self) -> Self;

    /// Sign -1, 0 or 1; zero if the magnitude is at most `dead_band`. Its derivative is defined as zero.
    fn sign(self, dead_band: f64) -> Self;

    /// `tanh(self / width)`.
    fn smooth_step(self, width: f64) -> Self;

    /// `e^{-self}` of a nonnegative value.
    fn decay(self) -> Self;

    /// Natural logarithm of a positive value.
    fn ln(self) -> Self;

    /// `self^exponent` of a nonnegative value.
    fn power(self, exponent: f64) -> Self;
}

impl Real for f64 {
    fn over(self, divisor: Self) -> Self {
        self / divisor
    }

    fn abs(self) -> Self {
        self.abs()
    }

    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    fn sign(self, dead_band: f64) -> Self {
        if self.abs() <= dead_band { 0.0 } else { self.signum() }
    }

    fn smooth_step(self, width: f64) -> Self {
        (self / width).tanh()
    }

    fn decay(self) -> Self {
        (-self).exp()
    }

    fn ln(self) -> Self {
        self.ln()
    }

    /// Avoids a general power for common exponents.
    fn power(self, exponent: f64) -> Self {
        const CUBE_ROOT: f64 = 1.0 / 3.0;
        match exponent {
            1.0 => self,
            2.0 => self * self,
            0.5 => self.sqrt(),
            CUBE_ROOT => self.cbrt(),
            _ => self.powf(exponent),
        }
    }
}
