//! Sine and cosine of all lanes at once.
//!
//! Reduction to [-π/4, π/4] by a three-part π/2 (Cody and Waite 1980), then the minimax polynomials of the standard
//! mathematical libraries (fdlibm's `__kernel_sin`, `__kernel_cos`: degrees 13 and 14, error below 2^-58). Branch-free
//! except for rare angles beyond [`MAX_ANGLE_RAD`], which use the standard library.

use crate::register::Register;

/// Limit of the three-part reduction: `n` must be exact with 33-bit parts of π/2.
const MAX_ANGLE_RAD: f64 = 1.0e5;

const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
// π/2 as the sum of three parts, the first two with 33 significant bits, so that n times each is exact for n < 2^20.
const HALF_PI_1: f64 = 1.570_796_326_734_125_6;
const HALF_PI_2: f64 = 6.077_100_506_303_966e-11;
const HALF_PI_3: f64 = 2.022_266_248_795_950_6e-21;
/// 1.5 · 2^52: adding it rounds to the nearest integer, which is then in the low bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine and cosine of every lane, angles in radians.
#[inline(always)]
pub(crate) fn sin_cos<R: Register>(angle: R) -> (R, R) {
    let rounded = angle.mul_add(R::splat(TWO_OVER_PI), R::splat(ROUND));
    let n = rounded.sub(R::splat(ROUND));
    let x = n.neg_mul_add(R::splat(HALF_PI_1), angle);
    let x = n.neg_mul_add(R::splat(HALF_PI_2), x);
    let x = n.neg_mul_add(R::splat(HALF_PI_3), x);
    let z = x.mul(x);
    let (mut s, mut c) = (R::splat(SIN[5]), R::splat(COS[5]));
    for k in (0..5).rev() {
        s = s.mul_add(z, R::splat(SIN[k]));
        c = c.mul_add(z, R::splat(COS[k]));
    }
    let s = s.mul_add(z.mul(x), x);
    let c = z.mul(z).mul_add(c, z.mul_add(R::splat(-0.5), R::ONE));
    // Odd quadrants swap sine and cosine; the signs follow from the quadrant's two low bits.
    let swap = s.xor(c).and(rounded.lowest_bit_mask());
    let sign = R::splat(-0.0);
    let sine = s.xor(swap).xor(half_turn(rounded).and(sign));
    let cosine = c.xor(swap).xor(half_turn(rounded.bits_plus(1)).and(sign));
    if angle.all_within(MAX_ANGLE_RAD) { (sine, cosine) } else { by_standard_library(angle) }
}

/// Moves the second lowest bit to the sign (with the lowest bit below it, for the caller to mask).
#[inline(always)]
fn half_turn<R: Register>(bits: R) -> R {
    bits.bits_shifted_by_62()
}

#[cold]
fn by_standard_library<R: Register>(angle: R) -> (R, R) {
    let (mut sine, mut cosine) = ([0.0; 8], [0.0; 8]);
    angle.store(&mut sine);
    for k in 0..R::LANES {
        (sine[k], cosine[k]) = sine[k].sin_cos();
    }
    (R::load(&sine), R::load(&cosine))
}

#[cfg(test)]
mod tests {
    use super::sin_cos;
    use crate::portable::Portable;
    use crate::register::Register;

    fn sin_cos_lanes<const N: usize, const FUSED: bool>(angles: [f64; N]) -> ([f64; N], [f64; N]) {
        let (s, c) = sin_cos(Portable::<N, FUSED>::load(&angles));
        let (mut sine, mut cosine) = ([0.0; N], [0.0; N]);
        s.store(&mut sine);
        c.store(&mut cosine);
        (sine, cosine)
    }

    #[test]
    fn agrees_with_the_standard_library() {
        // 2e-16 is one unit in the last place of a value near one; the reduction adds at most the same.
        let tolerance = 4.0e-16;
        let mut worst: f64 = 0.0;
        for k in 0..2_000_000_i64 {
            let x = (k - 1_000_000) as f64 * 0.1 * 1.000_000_7;
            let y = (k - 1_000_000) as f64 * 1.0e-5;
            let z = (k % 128 - 64) as f64 * core::f64::consts::FRAC_PI_4;
            let ([sx, sy, sz, _], [cx, cy, cz, _]) = sin_cos_lanes::<4, false>([x, y, z, 0.0]);
            for (angle, s, c) in [(x, sx, cx), (y, sy, cy), (z, sz, cz)] {
                worst = worst.max((angle.sin() - s).abs()).max((angle.cos() - c).abs());
            }
        }
        assert!(worst <= tolerance, "worst error {worst:e}");
    }

    #[test]
    fn infinities_and_huge_angles_go_to_the_standard_library() {
        let ([a, b], [c, d]) = sin_cos_lanes::<2, false>([1.0e17, f64::INFINITY]);
        assert_eq!((a, c), 1.0e17_f64.sin_cos());
        assert!(b.is_nan() && d.is_nan());
        let ([a, _], [c, _]) = sin_cos_lanes::<2, false>([f64::NAN, 1.0]);
        assert!(a.is_nan() && c.is_nan());
    }
}
