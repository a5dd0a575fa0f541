//! Lanes: one, four or eight `f64` that are processed together.

use crate::exponential::{decay, tanh};
use crate::real::Real;
use crate::register::Register;
use crate::scalar::Scalar;
use crate::sin_cos::sin_cos;
use core::marker::PhantomData;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A [`Real`] that contains several samples. Its step and decay are accurate to 4 units in the last place.
pub trait Lane: Real {
    /// Number of samples.
    const LANES: usize;

    /// The first [`LANES`](Lane::LANES) values of `values`.
    ///
    /// # Panics
    /// If `values` is shorter than [`LANES`](Lane::LANES).
    fn load(values: &[f64]) -> Self;

    /// Writes the lanes to the first places of `out`.
    ///
    /// # Panics
    /// If `out` is shorter than [`LANES`](Lane::LANES).
    fn store(self, out: &mut [f64]);

    /// The value in lane `index`.
    ///
    /// # Panics
    /// If `index` is not below [`LANES`](Lane::LANES).
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        assert!(index < Self::LANES);
        lanes[index]
    }

    /// Replaces the value in lane `index`.
    ///
    /// # Panics
    /// If `index` is not below [`LANES`](Lane::LANES).
    #[must_use]
    #[inline(always)]
    fn with_lane(self, index: usize, value: f64) -> Self {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        assert!(index < Self::LANES);
        lanes[index] = value;
        Self::load(&lanes)
    }

    /// True if every lane is at most that of `bound`; false if one of them is NaN.
    fn all_at_most(self, bound: Self) -> bool;

    /// Sum over the lanes, from first to last.
    #[inline(always)]
    fn sum(self) -> f64 {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        lanes[..Self::LANES].iter().sum()
    }

    /// Transposes four values of four lanes: lane `k` of value `i` goes to lane `i` of value `k`. Values with another
    /// number of lanes are returned unchanged.
    fn transposed(values: [Self; 4]) -> [Self; 4];

    /// Lane type for several values of this type: several joints of a single sample, or one value if the lanes are
    /// samples already. Code that vectorises *inside* one sample uses bundles.
    type Bundle: Lane;

    /// Number of values of this type in a [`Bundle`](Lane::Bundle): more than one only if a value is one sample.
    const PER_BUNDLE: usize = Self::Bundle::LANES / Self::LANES;

    /// The bundle with this value in every place.
    fn bundle(self) -> Self::Bundle;

    /// Adds this value at place `index` of the bundle.
    ///
    /// # Panics
    /// If `index` is not below [`PER_BUNDLE`](Lane::PER_BUNDLE).
    fn add_at(self, bundle: &mut Self::Bundle, index: usize);
}

/// Lanes in the register `R`, with bundles in the register `B`.
pub(crate) struct Wide<R, B = R>(R, PhantomData<B>);

impl<R: Register, B> Wide<R, B> {
    #[inline(always)]
    const fn of(register: R) -> Self {
        Self(register, PhantomData)
    }
}

impl<R: Copy, B> Clone for Wide<R, B> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<R: Copy, B> Copy for Wide<R, B> {}

impl<R: core::fmt::Debug, B> core::fmt::Debug for Wide<R, B> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.0.fmt(f)
    }
}

impl<R: Register, B> Add for Wide<R, B> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::of(self.0.add(other.0))
    }
}
impl<R: Register, B> Sub for Wide<R, B> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::of(self.0.sub(other.0))
    }
}
impl<R: Register, B> Mul for Wide<R, B> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::of(self.0.mul(other.0))
    }
}
impl<R: Register, B> Neg for Wide<R, B> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::of(self.0.neg())
    }
}
impl<R: Register, B> AddAssign for Wide<R, B> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
impl<R: Register, B> SubAssign for Wide<R, B> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<R: Register, B: Register> Scalar for Wide<R, B> {
    const ZERO: Self = Self::of(R::ZERO);
    const ONE: Self = Self::of(R::ONE);
    const ANGLES_AT_ONCE: usize = Self::PER_BUNDLE;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::of(R::splat(value))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self::of(self.0.mul_add(factor.0, addend.0))
    }

    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self::of(self.0.neg_mul_add(factor.0, addend.0))
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = sin_cos(self.0);
        (Self::of(sin), Self::of(cos))
    }

    #[inline(always)]
    fn sin_cos_all(angles: &[Self], sines: &mut [Self], cosines: &mut [Self]) {
        // A bundle takes several angles at once; with one value per bundle this is a plain loop.
        let count = angles.len().min(sines.len()).min(cosines.len());
        let (angles, sines, cosines) = (&angles[..count], &mut sines[..count], &mut cosines[..count]);
        let whole = count - count % Self::PER_BUNDLE;
        let mut start = 0;
        while start < whole {
            // The constant length avoids an inner loop.
            let end = start + Self::PER_BUNDLE;
            sin_cos_bundle(&angles[start..end], &mut sines[start..end], &mut cosines[start..end]);
            start = end;
        }
        if whole < count {
            sin_cos_bundle(&angles[whole..], &mut sines[whole..], &mut cosines[whole..]);
        }
    }

    #[inline(always)]
    fn recip(self) -> Self {
        Self::of(R::ONE.div(self.0))
    }
}

/// Sines and cosines of at most as many angles as one bundle contains.
#[inline(always)]
fn sin_cos_bundle<R: Register, B: Register>(
    angles: &[Wide<R, B>],
    sines: &mut [Wide<R, B>],
    cosines: &mut [Wide<R, B>],
) {
    let mut packed = [0.0; 8];
    for (k, angle) in angles.iter().enumerate() {
        angle.store(&mut packed[k * R::LANES..]);
    }
    let (mut sine, mut cosine) = ([0.0; 8], [0.0; 8]);
    let (s, c) = sin_cos(B::load(&packed));
    s.store(&mut sine);
    c.store(&mut cosine);
    for (k, (sin, cos)) in sines.iter_mut().zip(cosines).enumerate() {
        *sin = Wide::load(&sine[k * R::LANES..]);
        *cos = Wide::load(&cosine[k * R::LANES..]);
    }
}

impl<R: Register, B: Register> Wide<R, B> {
    /// Applies a scalar function to every lane.
    #[inline(always)]
    fn each(self, function: impl Fn(f64) -> f64) -> Self {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        lanes[..R::LANES].iter_mut().for_each(|lane| *lane = function(*lane));
        Self::load(&lanes)
    }
}

impl<R: Register, B: Register> Real for Wide<R, B> {
    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        Self::of(self.0.div(divisor.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::of(self.0.and(R::splat(f64::from_bits(!(1 << 63)))))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self::of(self.0.min(other.0))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::of(self.0.max(other.0))
    }

    #[inline(always)]
    fn sign(self, dead_band: f64) -> Self {
        self.each(|lane| lane.sign(dead_band))
    }

    #[inline(always)]
    fn smooth_step(self, width: f64) -> Self {
        Self::of(tanh(self.0.div(R::splat(width))))
    }

    #[inline(always)]
    fn decay(self) -> Self {
        Self::of(decay(self.0))
    }

    #[inline(always)]
    fn ln(self) -> Self {
        self.each(f64::ln)
    }

    #[inline(always)]
    fn power(self, exponent: f64) -> Self {
        self.each(|lane| lane.power(exponent))
    }
}

impl<R: Register, B: Register> Lane for Wide<R, B> {
    const LANES: usize = R::LANES;
    type Bundle = Wide<B>;

    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        Self::of(R::load(values))
    }

    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        self.0.store(out);
    }

    #[inline(always)]
    fn all_at_most(self, bound: Self) -> bool {
        self.0.all_at_most(bound.0)
    }

    #[inline(always)]
    fn transposed(values: [Self; 4]) -> [Self; 4] {
        let [a, b, c, d] = R::transposed([values[0].0, values[1].0, values[2].0, values[3].0]);
        [Self::of(a), Self::of(b), Self::of(c), Self::of(d)]
    }

    #[inline(always)]
    fn bundle(self) -> Wide<B> {
        if R::LANES == 1 {
            Wide::of(B::splat(self.0.first()))
        } else {
            let mut lanes = [0.0; 8];
            self.0.store(&mut lanes);
            Wide::of(B::load(&lanes))
        }
    }

    #[inline(always)]
    fn add_at(self, bundle: &mut Wide<B>, index: usize) {
        if R::LANES == 1 {
            bundle.0 = B::splat(self.0.first()).mul_add(B::load(&UNIT[index]), bundle.0);
        } else {
            assert_eq!(index, 0);
            *bundle += self.bundle();
        }
    }
}

/// Row `k` has a one at place `k`. A product with it places a value without using memory.
const UNIT: [[f64; 8]; 8] = {
    let mut rows = [[0.0; 8]; 8];
    let mut k = 0;
    while k < 8 {
        rows[k][k] = 1.0;
        k += 1;
    }
    rows
};
