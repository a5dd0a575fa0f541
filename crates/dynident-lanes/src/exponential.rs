//! Hyperbolic tangent and decay of all lanes at once, for smooth friction.
//!
//! `e^y = 2^n e^r` with n the integer nearest to `y / ln 2` and `|r| ≤ ln 2 / 2`, reduced by ln 2 in two parts (Cody
//! and Waite, *Software Manual for the Elementary Functions*, 1980); `e^r − 1` by its power series to degree 13, whose
//! next term is below 2^-57 of the sum. With `m = e^{2|x|} − 1` the tangent is `m / (m + 2)`, which keeps all digits
//! near zero.

use crate::register::Register;

// ln 2 as the sum of two parts, the first with 33 significant bits, so that n times it is exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// 1.5 · 2^52: adding it rounds to the nearest integer, which is then in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;
/// Exponent bias of a double.
const BIAS: u64 = 1023;
/// `1/k!` for k from 2 to 13.
const SERIES: [f64; 12] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];
/// The tangent of larger arguments is 1 in double precision.
const MAX_TANH_ARGUMENT: f64 = 22.0;
/// `e^-x` of larger arguments is subnormal.
const MAX_DECAY_ARGUMENT: f64 = 708.0;

/// `2^n` and `e^r − 1` with `e^y = 2^n e^r`; |y| at most 708.
#[inline(always)]
fn reduced<R: Register>(y: R) -> (R, R) {
    let rounded = y.mul_add(R::splat(core::f64::consts::LOG2_E), R::splat(ROUND));
    let n = rounded.sub(R::splat(ROUND));
    let r = n.neg_mul_add(R::splat(LN_2_LOW), n.neg_mul_add(R::splat(LN_2_HIGH), y));
    let mut q = R::splat(SERIES[11]);
    for k in (0..11).rev() {
        q = q.mul_add(r, R::splat(SERIES[k]));
    }
    (rounded.bits_plus(BIAS).bits_shifted_by_52(), r.mul(r).mul_add(q, r))
}

/// Hyperbolic tangent of every lane; NaN for NaN.
#[inline(always)]
pub(crate) fn tanh<R: Register>(x: R) -> R {
    let sign = x.and(R::splat(-0.0));
    let size = R::splat(MAX_TANH_ARGUMENT).min(x.xor(sign));
    let (power, less_one) = reduced(size.add(size));
    let m = power.mul_add(less_one, power.sub(R::ONE));
    m.div(m.add(R::splat(2.0))).xor(sign)
}

/// `e^-x` of every nonnegative lane; NaN for NaN.
#[inline(always)]
pub(crate) fn decay<R: Register>(x: R) -> R {
    let (power, less_one) = reduced(R::ZERO.sub(R::splat(MAX_DECAY_ARGUMENT).min(x)));
    power.mul_add(less_one, power)
}
