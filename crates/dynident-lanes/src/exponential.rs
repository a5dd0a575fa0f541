//! Hyperbolic tangent and decay of all lanes at once: what smooth friction is made of.
//!
//! `e^y = 2^n e^r` with n the integer nearest to `y / ln 2` and `|r| ≤ ln 2 / 2`, reduced by ln 2 in two parts (Cody
//! and Waite, *Software Manual for the Elementary Functions*, 1980); `e^r − 1` by its power series to degree 13, whose
//! next term is below 2^-57 of the sum. With `m = e^{2|x|} − 1` the tangent is `m / (m + 2)`: no digits are lost near
//! zero.

use crate::dispatch::{Level, dispatch};
use crate::kernel::Kernel;
use crate::lanes::Lane;
use crate::register::Register;

// ln 2 as the sum of two parts, the first with 33 significant bits, so that n times it is exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// 1.5 · 2^52: adding it rounds to the nearest integer and leaves that integer in the low bits.
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
/// From here on the tangent is 1 to the last bit.
const TANH_IS_ONE: f64 = 22.0;
/// From here on `e^-x` is no normal number.
const LARGEST_DECAY: f64 = 708.0;

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

/// Hyperbolic tangent of every lane; not a number where the lane is none.
#[inline(always)]
pub(crate) fn tanh<R: Register>(x: R) -> R {
    let sign = x.and(R::splat(-0.0));
    let size = R::splat(TANH_IS_ONE).min(x.xor(sign));
    let (power, less_one) = reduced(size.add(size));
    let m = power.mul_add(less_one, power.sub(R::ONE));
    m.div(m.add(R::splat(2.0))).xor(sign)
}

/// `e^-x` of every lane, none of which is negative; not a number where the lane is none.
#[inline(always)]
pub(crate) fn decay<R: Register>(x: R) -> R {
    let (power, less_one) = reduced(R::ZERO.sub(R::splat(LARGEST_DECAY).min(x)));
    power.mul_add(less_one, power)
}

/// Writes `tanh(values / width)` to `out`, as many as there are in the shorter of the two; within 4 units of the last
/// place, the same wherever in the slice a value stands.
pub fn tanh_all(values: &[f64], width: f64, out: &mut [f64]) {
    dispatch(Level::detect(), All { values, out, of: Tanh { width } });
}

/// Writes `e^{-values}` to `out`, as many as there are in the shorter of the two, for values that are not negative;
/// within 4 units of the last place, and `e^-708` beyond 708.
pub fn decay_all(values: &[f64], out: &mut [f64]) {
    dispatch(Level::detect(), All { values, out, of: Decay });
}

trait OfLane: Copy {
    fn of<T: Lane>(self, x: T) -> T;
}

#[derive(Clone, Copy)]
struct Tanh {
    width: f64,
}

impl OfLane for Tanh {
    #[inline(always)]
    fn of<T: Lane>(self, x: T) -> T {
        x.divided_by(self.width).tanh()
    }
}

#[derive(Clone, Copy)]
struct Decay;

impl OfLane for Decay {
    #[inline(always)]
    fn of<T: Lane>(self, x: T) -> T {
        x.decay()
    }
}

struct All<'a, F> {
    values: &'a [f64],
    out: &'a mut [f64],
    of: F,
}

impl<F: OfLane> Kernel for All<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<T: Lane>(self) {
        let count = self.values.len().min(self.out.len());
        let whole = count - count % T::LANES;
        let (values, out) = (&self.values[..count], &mut self.out[..count]);
        for (from, to) in values.chunks_exact(T::LANES).zip(out.chunks_exact_mut(T::LANES)) {
            self.of.of(T::load(from)).store(to);
        }
        let mut last = [0.0; 8];
        last[..count - whole].copy_from_slice(&values[whole..]);
        self.of.of(T::load(&last)).store(&mut last);
        out[whole..].copy_from_slice(&last[..count - whole]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What four units of the last place are of a value.
    fn near(found: f64, expected: f64) -> bool {
        found == expected || (found - expected).abs() <= 4.0 * f64::EPSILON * expected.abs()
    }

    /// Numbers of every size and sign up to 1e4.
    fn values() -> Vec<f64> {
        let sizes = (-300..=80).map(|k| 10.0_f64.powf(f64::from(k) / 20.0));
        let fine = (0..20_001).map(|k| f64::from(k) * 2.5e-3);
        sizes.chain(fine).flat_map(|x| [x, -x]).collect()
    }

    #[test]
    fn they_agree_with_the_standard_library_at_every_level() {
        let values = values();
        for level in Level::available() {
            let mut out = vec![0.0; values.len()];
            dispatch(level, All { values: &values, out: &mut out, of: Tanh { width: 0.3 } });
            for (x, y) in values.iter().zip(&out) {
                assert!(near(*y, (x / 0.3).tanh()), "{}: tanh({x} / 0.3) = {y}", level.name());
            }
            let sizes: Vec<f64> = values.iter().map(|x| x.abs().min(700.0)).collect();
            dispatch(level, All { values: &sizes, out: &mut out, of: Decay });
            for (x, y) in sizes.iter().zip(&out) {
                assert!(near(*y, (-x).exp()), "{}: e^-{x} = {y}", level.name());
            }
        }
    }

    #[test]
    fn the_ends_are_right_and_what_is_no_number_stays_none() {
        let mut out = [0.0; 6];
        tanh_all(&[0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300], 1.0, &mut out);
        assert_eq!(out[..4], [0.0, -0.0, 1.0, -1.0]);
        assert!(out[1].is_sign_negative() && out[4].is_nan() && out[5] == 1.0);
        decay_all(&[0.0, f64::INFINITY, f64::NAN, 1e300], &mut out);
        assert!(out[0] == 1.0 && out[1] < 1e-300 && out[2].is_nan() && out[3] < 1e-300);
    }

    #[test]
    fn a_value_is_the_same_wherever_it_stands() {
        let values = values();
        let (mut all, mut one) = (vec![0.0; values.len()], [0.0]);
        tanh_all(&values, 0.02, &mut all);
        for (x, y) in values.iter().zip(&all).step_by(97) {
            tanh_all(&[*x], 0.02, &mut one);
            assert_eq!(y.to_bits(), one[0].to_bits(), "{x}");
        }
    }
}
