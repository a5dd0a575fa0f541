//! The one trait under the dynamics core.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A number that rigid-body algorithms can be written over: `f64`, lanes of `f64`, dual numbers.
///
/// Deliberately small: the four operations, [`mul_add`](Scalar::mul_add), [`sin_cos`](Scalar::sin_cos) and
/// [`recip`](Scalar::recip). There is no ordering, because lanes and duals have no single one; algorithms over
/// `Scalar` are branch-free in their data.
pub trait Scalar:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + 'static
{
    /// Zero in every lane, derivative zero.
    const ZERO: Self;
    /// One in every lane, derivative zero.
    const ONE: Self;

    /// The constant `value` (in every lane, with derivative zero).
    fn splat(value: f64) -> Self;

    /// `self * factor + addend`, fused to one rounding where the processor level has it.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// Sine and cosine of an angle in radians, each within 1e-15 absolute for |angle| up to 1e5 rad, and by the
    /// standard library beyond.
    fn sin_cos(self) -> (Self, Self);

    /// `1 / self`.
    fn recip(self) -> Self;

    /// How many angles [`sin_cos_all`](Scalar::sin_cos_all) takes in one step: whole multiples cost least.
    const ANGLES_AT_ONCE: usize = 1;

    /// [`sin_cos`](Scalar::sin_cos) of every angle; the shorter of the three slices ends it.
    #[inline(always)]
    fn sin_cos_all(angles: &[Self], sines: &mut [Self], cosines: &mut [Self]) {
        for ((angle, sine), cosine) in angles.iter().zip(sines).zip(cosines) {
            (*sine, *cosine) = angle.sin_cos();
        }
    }

    /// `addend - self * factor`.
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        (-self).mul_add(factor, addend)
    }
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    /// Two roundings: a fused `f64::mul_add` is a slow library call where the build target lacks the instruction.
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }

    #[inline(always)]
    fn recip(self) -> Self {
        1.0 / self
    }
}
