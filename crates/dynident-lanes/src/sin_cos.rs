//! Sine and cosine of all lanes at once.
//!
//! Reduction to [-π/4, π/4] by a three-part π/2 (Cody and Waite 1980), then the minimax polynomials of the same interval
//! that the standard mathematical libraries use (fdlibm's `__kernel_sin`, `__kernel_cos`: degrees 13 and 14, error below 2^-58).
//! Branch-free but for the rare angle beyond [`LARGEST_ANGLE`], where the standard library takes over.

/// Beyond this the three-part reduction loses digits: `n` has to stay exact against 33-bit parts of π/2.
const LARGEST_ANGLE: f64 = 1.0e5;

const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
// π/2 as the sum of three parts, the first two with 33 significant bits, so that n times each is exact for n < 2^20.
const HALF_PI_1: f64 = 1.570_796_326_734_125_6;
const HALF_PI_2: f64 = 6.077_100_506_303_966e-11;
const HALF_PI_3: f64 = 2.022_266_248_795_950_6e-21;
/// 1.5 · 2^52: adding it rounds to the nearest integer and leaves that integer in the low bits.
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

#[inline(always)]
fn mul_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Sine and cosine of `N` angles in radians.
#[inline(always)]
pub(crate) fn sin_cos_lanes<const N: usize, const FUSED: bool>(angle: [f64; N]) -> ([f64; N], [f64; N]) {
    let (mut sin, mut cos) = ([0.0; N], [0.0; N]);
    let mut all_small = true;
    for i in 0..N {
        all_small &= angle[i].abs() <= LARGEST_ANGLE;
    }
    for i in 0..N {
        let rounded = mul_add::<FUSED>(angle[i], TWO_OVER_PI, ROUND);
        let n = rounded - ROUND;
        let bits = rounded.to_bits();
        let x = mul_add::<FUSED>(-n, HALF_PI_1, angle[i]);
        let x = mul_add::<FUSED>(-n, HALF_PI_2, x);
        let x = mul_add::<FUSED>(-n, HALF_PI_3, x);
        let z = x * x;
        let mut s = SIN[5];
        let mut c = COS[5];
        for k in (0..5).rev() {
            s = mul_add::<FUSED>(s, z, SIN[k]);
            c = mul_add::<FUSED>(c, z, COS[k]);
        }
        let s = mul_add::<FUSED>(s, z * x, x);
        let c = mul_add::<FUSED>(z * z, c, mul_add::<FUSED>(z, -0.5, 1.0));
        // Odd quadrants swap sine and cosine; the signs follow from the quadrant's two low bits.
        let odd = 0_u64.wrapping_sub(bits & 1);
        let (s, c) = (s.to_bits(), c.to_bits());
        let sine = (s & !odd) | (c & odd);
        let cosine = (c & !odd) | (s & odd);
        sin[i] = f64::from_bits(sine ^ ((bits & 2) << 62));
        cos[i] = f64::from_bits(cosine ^ ((bits.wrapping_add(1) & 2) << 62));
    }
    if !all_small {
        for i in 0..N {
            (sin[i], cos[i]) = angle[i].sin_cos();
        }
    }
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::sin_cos_lanes;

    #[test]
    fn agrees_with_the_standard_library() {
        // 2e-16 is one unit in the last place of a value near one; the reduction adds at most as much again.
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
