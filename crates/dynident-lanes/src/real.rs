//! The scalar of friction laws: the four operations and the functions of real numbers that laws are made of.

use crate::scalar::Scalar;

/// A [`Scalar`] with functions of real numbers.
///
/// A law `f(q̇)` that is written once over `Real` gives its value on `f64`, a column of samples on lanes
/// ([`map_all`](crate::map_all)), its slope on [`Dual`](crate::Dual) and generated code on symbols.
pub trait Real: Scalar {
    /// `self / divisor`.
    fn over(self, divisor: Self) -> Self;

    /// Magnitude.
    fn abs(self) -> Self;

    /// The lesser of the two; `other` where one of them is not a number.
    fn min(self, other: Self) -> Self;

    /// The greater of the two; `other` where one of them is not a number.
    fn max(self, other: Self) -> Self;

    /// The sign: -1, 0 or 1, and zero while the magnitude is at most `dead_band`. Its derivative is taken as zero.
    fn sign(self, dead_band: f64) -> Self;

    /// `tanh(self / width)`.
    fn smooth_step(self, width: f64) -> Self;

    /// `e^{-self}` of a value that is not negative.
    fn decay(self) -> Self;

    /// Natural logarithm of a positive value.
    fn ln(self) -> Self;

    /// `self^exponent` of a value that is not negative.
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

    /// The usual exponents without a general power.
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
