//! The scalar trait of the dynamics core.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A number for rigid-body algorithms: `f64`, lanes of `f64`, dual numbers.
///
/// The trait is small: arithmetic, [`mul_add`](Scalar::mul_add), [`sin_cos`](Scalar::sin_cos) and
/// [`recip`](Scalar::recip). It has no ordering, because lanes and duals have no unique one; algorithms over `Scalar`
/// do not branch on their data.
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

    /// `self * factor + addend`, fused to one rounding if the processor level supports it.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// Sine and cosine of an angle in radians, each within 1e-15 absolute for |angle| up to 1e5 rad, and by the
    /// standard library beyond.
    fn sin_cos(self) -> (Self, Self);

    /// `1 / self`.
    fn recip(self) -> Self;

    /// Number of angles that [`sin_cos_all`](Scalar::sin_cos_all) processes together: whole multiples are fastest.
    const ANGLES_AT_ONCE: usize = 1;

    /// [`sin_cos`](Scalar::sin_cos) of every angle, up to the shortest slice.
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

    /// Two roundings: a fused `f64::mul_add` is a slow library call if the build target lacks the instruction.
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
