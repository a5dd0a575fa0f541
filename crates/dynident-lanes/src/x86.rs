//! AVX2 and AVX-512 registers and entry functions. **All `unsafe` code of Dynident's core is in this file.**
//!
//! Soundness: every intrinsic here needs a processor feature. The register types are private to this crate, so they
//! occur only as type parameter of [`Kernel::run`], which only [`enter_avx2`] and [`enter_avx512`] call with them.
//! These require a proof of the run-time check: [`HasAvx2`] and [`HasAvx512`] cannot be created otherwise. Loads and
//! stores check lengths first.
//!
//! Intrinsics are needed because the compiler does not reliably turn arrays of eight `f64` into AVX-512 code
//! (measured: ten times slower; see `docs/decisions/0003-lanes.md`).

#![allow(unsafe_code, reason = "SIMD intrinsics; see the module documentation for why it is sound")]

use crate::kernel::Kernel;
use crate::lanes::Lane;
use crate::register::Register;
#[allow(clippy::wildcard_imports, reason = "fifty intrinsics, used in this file only")]
use core::arch::x86_64::*;

/// Proof that the processor has AVX2 and FMA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HasAvx2(());

impl HasAvx2 {
    pub(crate) fn detect() -> Option<Self> {
        (std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma")).then_some(Self(()))
    }
}

/// Proof that the processor has AVX-512 F, DQ and VL in addition to AVX2 and FMA.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HasAvx512(());

impl HasAvx512 {
    pub(crate) fn detect() -> Option<Self> {
        HasAvx2::detect()?;
        (std::is_x86_feature_detected!("avx512f")
            && std::is_x86_feature_detected!("avx512dq")
            && std::is_x86_feature_detected!("avx512vl"))
        .then_some(Self(()))
    }
}

#[target_feature(enable = "avx2,fma")]
fn with_avx2<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    kernel.run::<T>()
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn with_avx512<K: Kernel, T: Lane>(kernel: K) -> K::Output {
    kernel.run::<T>()
}

#[inline]
pub(crate) fn enter_avx2<K: Kernel, T: Lane>(_proof: HasAvx2, kernel: K) -> K::Output {
    // Sound: the proof guarantees these features.
    unsafe { with_avx2::<K, T>(kernel) }
}

#[inline]
pub(crate) fn enter_avx512<K: Kernel, T: Lane>(_proof: HasAvx512, kernel: K) -> K::Output {
    // Sound: the proof guarantees these features.
    unsafe { with_avx512::<K, T>(kernel) }
}

/// Four numbers in an AVX2 register.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Avx2(__m256d);

/// Eight numbers in an AVX-512 register.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Avx512(__m512d);

/// One intrinsic on lanes. Sound inside [`Register`] methods only: see the module documentation.
macro_rules! intrinsic {
    ($call:expr) => {
        unsafe { $call }
    };
}

impl Register for Avx2 {
    const LANES: usize = 4;
    const ZERO: Self = Self(intrinsic!(core::mem::transmute::<[f64; 4], __m256d>([0.0; 4])));
    const ONE: Self = Self(intrinsic!(core::mem::transmute::<[f64; 4], __m256d>([1.0; 4])));

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(intrinsic!(_mm256_set1_pd(value)))
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..4];
        Self(intrinsic!(_mm256_loadu_pd(values.as_ptr())))
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        let out = &mut out[..4];
        intrinsic!(_mm256_storeu_pd(out.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn first(self) -> f64 {
        intrinsic!(_mm256_cvtsd_f64(self.0))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_add_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_sub_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_mul_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_div_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn transposed([a, b, c, d]: [Self; 4]) -> [Self; 4] {
        let low = intrinsic!((_mm256_unpacklo_pd(a.0, b.0), _mm256_unpacklo_pd(c.0, d.0)));
        let high = intrinsic!((_mm256_unpackhi_pd(a.0, b.0), _mm256_unpackhi_pd(c.0, d.0)));
        [
            Self(intrinsic!(_mm256_permute2f128_pd::<0x20>(low.0, low.1))),
            Self(intrinsic!(_mm256_permute2f128_pd::<0x20>(high.0, high.1))),
            Self(intrinsic!(_mm256_permute2f128_pd::<0x31>(low.0, low.1))),
            Self(intrinsic!(_mm256_permute2f128_pd::<0x31>(high.0, high.1))),
        ]
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self(intrinsic!(_mm256_sub_pd(_mm256_set1_pd(-0.0), self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(intrinsic!(_mm256_fmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(intrinsic!(_mm256_fnmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_and_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_xor_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn bits_plus(self, addend: u64) -> Self {
        let bits = intrinsic!(_mm256_castpd_si256(self.0));
        let sum = intrinsic!(_mm256_add_epi64(bits, _mm256_set1_epi64x(addend.cast_signed())));
        Self(intrinsic!(_mm256_castsi256_pd(sum)))
    }
    #[inline(always)]
    fn bits_shifted_by_62(self) -> Self {
        Self(intrinsic!(_mm256_castsi256_pd(_mm256_slli_epi64::<62>(_mm256_castpd_si256(self.0)))))
    }
    #[inline(always)]
    fn bits_shifted_by_52(self) -> Self {
        Self(intrinsic!(_mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(self.0)))))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_min_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(intrinsic!(_mm256_max_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn lowest_bit_mask(self) -> Self {
        let bit = intrinsic!(_mm256_and_si256(_mm256_castpd_si256(self.0), _mm256_set1_epi64x(1)));
        Self(intrinsic!(_mm256_castsi256_pd(_mm256_sub_epi64(_mm256_setzero_si256(), bit))))
    }
    #[inline(always)]
    fn all_within(self, bound: f64) -> bool {
        let magnitude = intrinsic!(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0));
        let within = intrinsic!(_mm256_cmp_pd::<_CMP_LE_OQ>(magnitude, _mm256_set1_pd(bound)));
        intrinsic!(_mm256_movemask_pd(within)) == 0b1111
    }
    #[inline(always)]
    fn all_at_most(self, bound: Self) -> bool {
        intrinsic!(_mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, bound.0))) == 0b1111
    }
}

impl Register for Avx512 {
    const LANES: usize = 8;
    const ZERO: Self = Self(intrinsic!(core::mem::transmute::<[f64; 8], __m512d>([0.0; 8])));
    const ONE: Self = Self(intrinsic!(core::mem::transmute::<[f64; 8], __m512d>([1.0; 8])));

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(intrinsic!(_mm512_set1_pd(value)))
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..8];
        Self(intrinsic!(_mm512_loadu_pd(values.as_ptr())))
    }
    #[inline(always)]
    fn store(self, out: &mut [f64]) {
        let out = &mut out[..8];
        intrinsic!(_mm512_storeu_pd(out.as_mut_ptr(), self.0));
    }
    #[inline(always)]
    fn first(self) -> f64 {
        intrinsic!(_mm512_cvtsd_f64(self.0))
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_add_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_sub_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_mul_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_div_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn transposed(rows: [Self; 4]) -> [Self; 4] {
        rows
    }
    #[inline(always)]
    fn neg(self) -> Self {
        Self(intrinsic!(_mm512_sub_pd(_mm512_set1_pd(-0.0), self.0)))
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(intrinsic!(_mm512_fmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn neg_mul_add(self, factor: Self, addend: Self) -> Self {
        Self(intrinsic!(_mm512_fnmadd_pd(self.0, factor.0, addend.0)))
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_and_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_xor_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn bits_plus(self, addend: u64) -> Self {
        let bits = intrinsic!(_mm512_castpd_si512(self.0));
        let sum = intrinsic!(_mm512_add_epi64(bits, _mm512_set1_epi64(addend.cast_signed())));
        Self(intrinsic!(_mm512_castsi512_pd(sum)))
    }
    #[inline(always)]
    fn bits_shifted_by_62(self) -> Self {
        Self(intrinsic!(_mm512_castsi512_pd(_mm512_slli_epi64::<62>(_mm512_castpd_si512(self.0)))))
    }
    #[inline(always)]
    fn bits_shifted_by_52(self) -> Self {
        Self(intrinsic!(_mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(self.0)))))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_min_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(intrinsic!(_mm512_max_pd(self.0, other.0)))
    }
    #[inline(always)]
    fn lowest_bit_mask(self) -> Self {
        let bit = intrinsic!(_mm512_and_si512(_mm512_castpd_si512(self.0), _mm512_set1_epi64(1)));
        Self(intrinsic!(_mm512_castsi512_pd(_mm512_sub_epi64(_mm512_setzero_si512(), bit))))
    }
    #[inline(always)]
    fn all_within(self, bound: f64) -> bool {
        let magnitude = intrinsic!(_mm512_abs_pd(self.0));
        intrinsic!(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(magnitude, _mm512_set1_pd(bound))) == 0xff
    }
    #[inline(always)]
    fn all_at_most(self, bound: Self) -> bool {
        intrinsic!(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, bound.0)) == 0xff
    }
}
