//! Dual numbers: a value and its derivative along one direction.

use crate::real::Real;
use crate::scalar::Scalar;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// `value + derivative·ε` with `ε² = 0`: computes the exact directional derivative of any algorithm over [`Scalar`].
///
/// ```
/// use dynident_lanes::{Dual, Scalar};
/// let q = Dual { value: 0.3, derivative: 1.0 };
/// let (sin, _) = q.sin_cos();
/// assert_eq!(sin.derivative, 0.3_f64.cos());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual {
    /// The value.
    pub value: f64,
    /// The derivative of the value along the chosen direction.
    pub derivative: f64,
}

impl Dual {
    /// A constant: derivative zero.
    pub fn constant(value: f64) -> Self {
        Self { value, derivative: 0.0 }
    }

    /// The variable of differentiation: derivative one.
    pub fn variable(value: f64) -> Self {
        Self { value, derivative: 1.0 }
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, derivative: self.derivative + other.derivative }
    }
}
impl Sub for Dual {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, derivative: self.derivative - other.derivative }
    }
}
impl Mul for Dual {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            derivative: self.derivative * other.value + self.value * other.derivative,
        }
    }
}
impl Neg for Dual {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, derivative: -self.derivative }
    }
}
impl AddAssign for Dual {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl SubAssign for Dual {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}
impl Scalar for Dual {
    const ZERO: Self = Self { value: 0.0, derivative: 0.0 };
    const ONE: Self = Self { value: 1.0, derivative: 0.0 };

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::constant(value)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.value.sin_cos();
        (
            Self { value: sin, derivative: cos * self.derivative },
            Self { value: cos, derivative: -sin * self.derivative },
        )
    }

    #[inline(always)]
    fn recip(self) -> Self {
        let value = 1.0 / self.value;
        Self { value, derivative: -value * value * self.derivative }
    }
}

impl Dual {
    /// Applies a function with this value and slope. An infinite slope (a root at zero) is ignored for a constant
    /// argument.
    fn through(self, value: f64, slope: f64) -> Self {
        Self { value, derivative: if self.derivative == 0.0 { 0.0 } else { slope * self.derivative } }
    }
}

impl Real for Dual {
    fn over(self, divisor: Self) -> Self {
        let value = self.value / divisor.value;
        Self { value, derivative: (self.derivative - value * divisor.derivative) / divisor.value }
    }

    fn abs(self) -> Self {
        self.through(self.value.abs(), self.value.sign(0.0))
    }

    fn min(self, other: Self) -> Self {
        if self.value < other.value { self } else { other }
    }

    fn max(self, other: Self) -> Self {
        if self.value > other.value { self } else { other }
    }

    fn sign(self, dead_band: f64) -> Self {
        Self::constant(self.value.sign(dead_band))
    }

    fn smooth_step(self, width: f64) -> Self {
        let step = self.value.smooth_step(width);
        self.through(step, (1.0 - step * step) / width)
    }

    fn decay(self) -> Self {
        let value = self.value.decay();
        if value == 0.0 { Self::ZERO } else { self.through(value, -value) }
    }

    fn ln(self) -> Self {
        self.through(self.value.ln(), 1.0 / self.value)
    }

    fn power(self, exponent: f64) -> Self {
        self.through(self.value.power(exponent), exponent * self.value.power(exponent - 1.0))
    }
}
