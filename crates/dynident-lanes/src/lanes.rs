//! Lanes: one, four or eight `f64` that take every step together.
//!
//! Plain arrays with element-wise loops; inside a `#[target_feature]` function ([`crate::dispatch()`]) the compiler turns
//! each loop into one vector instruction. `FUSED` says whether [`Scalar::mul_add`] may use the fused instruction,
//! which must only be asked for where the processor has it: elsewhere it is a slow library call.

use crate::scalar::Scalar;
use crate::sin_cos::sin_cos_lanes;
use core::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A [`Scalar`] that is a row of samples.
pub trait Lane: Scalar {
    /// How many samples stand side by side.
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
    fn lane(self, index: usize) -> f64;

    /// Sum over the lanes.
    fn sum(self) -> f64;

    /// The lane type that holds several values of this one side by side: eight joints of a single sample, or just one value where
    /// the lanes are samples already. What vectorises *inside* one sample is written over bundles.
    type Bundle: Lane;

    /// How many values of this type one [`Bundle`](Lane::Bundle) holds.
    const PER_BUNDLE: usize = Self::Bundle::LANES / Self::LANES;

    /// The bundle with this value in every place.
    fn bundle(self) -> Self::Bundle;

    /// Puts this value at place `index` of the bundle.
    ///
    /// # Panics
    /// If `index` is not below [`PER_BUNDLE`](Lane::PER_BUNDLE).
    fn put(self, bundle: &mut Self::Bundle, index: usize);
}

/// Samples are lanes already: a bundle is one value.
macro_rules! bundle_of_itself {
    () => {
        type Bundle = Self;

        #[inline(always)]
        fn bundle(self) -> Self {
            self
        }

        #[inline(always)]
        fn put(self, bundle: &mut Self, index: usize) {
            assert_eq!(index, 0);
            *bundle = self;
        }
    };
}

macro_rules! lanes {
    ($(#[$doc:meta])* $name:ident, $n:literal, $align:literal, $together:literal, { $($bundle:tt)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[repr(C, align($align))]
        pub struct $name<const FUSED: bool>(pub [f64; $n]);

        impl<const FUSED: bool> Add for $name<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn add(mut self, other: Self) -> Self {
                for i in 0..$n {
                    self.0[i] += other.0[i];
                }
                self
            }
        }
        impl<const FUSED: bool> Sub for $name<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn sub(mut self, other: Self) -> Self {
                for i in 0..$n {
                    self.0[i] -= other.0[i];
                }
                self
            }
        }
        impl<const FUSED: bool> Mul for $name<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn mul(mut self, other: Self) -> Self {
                for i in 0..$n {
                    self.0[i] *= other.0[i];
                }
                self
            }
        }
        impl<const FUSED: bool> Neg for $name<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn neg(mut self) -> Self {
                for i in 0..$n {
                    self.0[i] = -self.0[i];
                }
                self
            }
        }
        impl<const FUSED: bool> AddAssign for $name<FUSED> {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl<const FUSED: bool> SubAssign for $name<FUSED> {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
        impl<const FUSED: bool> Scalar for $name<FUSED> {
            const ZERO: Self = Self([0.0; $n]);
            const ONE: Self = Self([1.0; $n]);

            #[inline(always)]
            fn splat(value: f64) -> Self {
                Self([value; $n])
            }

            #[inline(always)]
            fn mul_add(mut self, factor: Self, addend: Self) -> Self {
                for i in 0..$n {
                    self.0[i] = if FUSED {
                        self.0[i].mul_add(factor.0[i], addend.0[i])
                    } else {
                        self.0[i] * factor.0[i] + addend.0[i]
                    };
                }
                self
            }

            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                let (sin, cos) = sin_cos_lanes::<$n, FUSED>(self.0);
                (Self(sin), Self(cos))
            }

            #[inline(always)]
            fn sin_cos_all(angles: &[Self], sines: &mut [Self], cosines: &mut [Self]) {
                // Narrow lanes would leave most of a register empty: take several angles into one.
                const WIDTH: usize = $n * $together;
                let count = angles.len().min(sines.len()).min(cosines.len());
                let mut start = 0;
                while start < count {
                    let end = (start + $together).min(count);
                    let mut packed = [0.0; WIDTH];
                    for (k, angle) in angles[start..end].iter().enumerate() {
                        packed[k * $n..(k + 1) * $n].copy_from_slice(&angle.0);
                    }
                    let (s, c) = sin_cos_lanes::<WIDTH, FUSED>(packed);
                    for k in 0..end - start {
                        sines[start + k].0.copy_from_slice(&s[k * $n..(k + 1) * $n]);
                        cosines[start + k].0.copy_from_slice(&c[k * $n..(k + 1) * $n]);
                    }
                    start = end;
                }
            }

            #[inline(always)]
            fn recip(mut self) -> Self {
                for i in 0..$n {
                    self.0[i] = 1.0 / self.0[i];
                }
                self
            }
        }
        impl<const FUSED: bool> Lane for $name<FUSED> {
            const LANES: usize = $n;

            #[inline(always)]
            fn load(values: &[f64]) -> Self {
                let mut lanes = [0.0; $n];
                lanes.copy_from_slice(&values[..$n]);
                Self(lanes)
            }

            #[inline(always)]
            fn store(self, out: &mut [f64]) {
                out[..$n].copy_from_slice(&self.0);
            }

            #[inline(always)]
            fn lane(self, index: usize) -> f64 {
                self.0[index]
            }

            #[inline(always)]
            fn sum(self) -> f64 {
                self.0.iter().sum()
            }

            $($bundle)*
        }
    };
}

lanes!(
    /// One sample.
    F64x1,
    1,
    8,
    8,
    {
        type Bundle = F64x8<FUSED>;

        #[inline(always)]
        fn bundle(self) -> F64x8<FUSED> {
            F64x8([self.0[0]; 8])
        }

        #[inline(always)]
        fn put(self, bundle: &mut F64x8<FUSED>, index: usize) {
            bundle.0[index] = self.0[0];
        }
    }
);
lanes!(
    /// Four samples: one AVX2 register, two NEON registers.
    F64x4,
    4,
    32,
    2,
    { bundle_of_itself!(); }
);
lanes!(
    /// Eight samples: one AVX-512 register.
    F64x8,
    8,
    64,
    1,
    { bundle_of_itself!(); }
);
