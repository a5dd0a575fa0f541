//! A logistic stroke (smooth move from one position to another) with exact rest outside its time window.

use dynident_lanes::Scalar;

/// A stroke: the logistic function of a warped time,
///
/// s(t) = 1/(1 + e^-φ), φ = κ u/(1 - u²), u = (t - c)/w,
///
/// multiplied by an amplitude, from 0 at t = c - w to 1 at t = c + w. φ tends to ±∞ at the ends of the window, so
/// that s reaches 0 and 1 there with **all** derivatives zero. This is the exact soft start and stop that Eq. 11 of
/// *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function* requires. Around the middle φ =
/// ω (t - c) with ω = κ/w: the logistic function of that paper with the same steepness (peak velocity Aω/4), which is
/// also the limit for large κ. κ = 2√3 has the flattest velocity at the middle; κ near 4 is similar to a minimum-jerk
/// move.
/// The inverse of φ(u) has a closed form, so velocity and acceleration are functions of position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogisticStroke {
    /// Distance from start to end, rad (m).
    pub amplitude: f64,
    /// Middle of the window, s.
    pub centre_s: f64,
    /// Half duration w of the window, s.
    pub half_duration_s: f64,
    /// Sharpness κ.
    pub sharpness: f64,
}

/// For larger |u| every κ >= 2√3 has φ > 3500, where e^-φ is zero in double precision: s and all its derivatives are
/// exact.
pub(super) const MAX_WARP: f64 = 1.0 - 1.0 / 2048.0;

impl LogisticStroke {
    /// Minimum κ, above which the velocity has a single peak in the middle.
    pub const LEAST_SHARPNESS: f64 = 3.464_101_615_137_755;

    /// Normalised time u, limited to the range in which the stroke moves.
    pub(super) fn warped(&self, time_s: f64) -> f64 {
        ((time_s - self.centre_s) / self.half_duration_s).clamp(-MAX_WARP, MAX_WARP)
    }

    /// Derivatives of q, q̇, q̈ and jerk at a time with respect to (amplitude, centre, half duration, sharpness).
    pub(super) fn derivatives_by_shape(&self, time_s: f64) -> [[f64; 4]; 4] {
        let u = self.warped(time_s);
        let psi = warp(u);
        let (value, bell) = logistic_and_bell(self.sharpness * psi[0]);
        let unit = unit_stroke(&psi, self.sharpness, value, bell);
        let inverse = 1.0 / self.half_duration_s;
        let mut scale = 1.0;
        core::array::from_fn(|order| {
            // A shift of the middle by dc changes u by -dc/w; a change of w scales u, so the derivative of order n is
            // -(u S_{n+1} + n S_n)/w.
            let stretched = u * unit.value[order + 1] + order as f64 * unit.value[order];
            let sized = self.amplitude * scale;
            let row = [
                scale * unit.value[order],
                -sized * inverse * unit.value[order + 1],
                -sized * inverse * stretched,
                sized * unit.by_sharpness[order],
            ];
            scale *= inverse;
            row
        })
    }
}

/// Derivatives with respect to u: of the unit stroke, orders 0 to 4, and of its derivative with respect to κ, orders
/// 0 to 3.
pub(super) struct StrokeDerivatives<T> {
    pub(super) value: [T; 5],
    pub(super) by_sharpness: [T; 4],
}

/// Taylor coefficients (of 1, x, .. x⁴ around `u`) of the warp ψ = u/(1 - u²).
#[inline(always)]
pub(super) fn warp<T: Scalar>(u: T) -> [T; 5] {
    // 1/(1 - u²), from (1 - u²) r = 1.
    let inverse = u.neg_mul_add(u, T::ONE).recip();
    let twice = u + u;
    let mut r = [inverse, T::ZERO, T::ZERO, T::ZERO, T::ZERO];
    r[1] = twice * r[0] * inverse;
    for n in 2..5 {
        r[n] = twice.mul_add(r[n - 1], r[n - 2]) * inverse;
    }
    let mut psi = [u * r[0]; 5];
    for n in 1..5 {
        psi[n] = u.mul_add(r[n], r[n - 1]);
    }
    psi
}

/// The unit stroke by Taylor arithmetic from its [`warp`], given the value and the derivative of the logistic function
/// at κψ.
#[inline(always)]
pub(super) fn unit_stroke<T: Scalar>(psi: &[T; 5], sharpness: T, value: T, bell: T) -> StrokeDerivatives<T> {
    let two = T::splat(2.0);
    let mut s = [value, T::ZERO, T::ZERO, T::ZERO, T::ZERO];
    let mut p = [bell, T::ZERO, T::ZERO, T::ZERO];
    let slope = T::ONE - two * value;
    for n in 1..5 {
        // s' = p φ'.
        let mut sum = T::ZERO;
        for i in 1..=n {
            sum = (T::splat(i as f64) * psi[i]).mul_add(p[n - i], sum);
        }
        s[n] = sum * sharpness * T::splat(1.0 / n as f64);
        if n < 4 {
            // p = s - s².
            let mut sum = slope * s[n];
            for i in 1..n {
                sum = s[i].neg_mul_add(s[n - i], sum);
            }
            p[n] = sum;
        }
    }
    // ∂s/∂κ = p ψ.
    let mut k = [T::ZERO; 4];
    for n in 0..4 {
        for i in 0..=n {
            k[n] = p[i].mul_add(psi[n - i], k[n]);
        }
    }
    // No closures here, because they would not be compiled for wide registers.
    let factorials = [1.0, 1.0, 2.0, 6.0, 24.0];
    for n in 2..5 {
        s[n] = s[n] * T::splat(factorials[n]);
        if n < 4 {
            k[n] = k[n] * T::splat(factorials[n]);
        }
    }
    StrokeDerivatives { value: s, by_sharpness: k }
}

/// 1/(1 + e^-φ) and its derivative, accurate far from the middle.
#[inline(always)]
pub(super) fn logistic_and_bell(phi: f64) -> (f64, f64) {
    let e = (-phi.abs()).exp();
    let d = 1.0 / (1.0 + e);
    (if phi >= 0.0 { d } else { e * d }, e * d * d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_lanes::Dual;
    use proptest::prelude::*;

    fn plain_stroke(u: f64, sharpness: f64) -> StrokeDerivatives<f64> {
        let psi = warp(u);
        let (value, bell) = logistic_and_bell(sharpness * psi[0]);
        unit_stroke(&psi, sharpness, value, bell)
    }

    fn dual_stroke(u: Dual, sharpness: Dual) -> StrokeDerivatives<Dual> {
        let psi = warp(u);
        let (value, bell) = dual_logistic(sharpness * psi[0]);
        unit_stroke(&psi, sharpness, value, bell)
    }

    fn dual_logistic(phi: Dual) -> (Dual, Dual) {
        let (s, p) = logistic_and_bell(phi.value);
        (
            Dual { value: s, derivative: p * phi.derivative },
            Dual { value: p, derivative: p * (1.0 - 2.0 * s) * phi.derivative },
        )
    }

    #[test]
    fn the_stroke_rests_outside_the_window() {
        for sharpness in [LogisticStroke::LEAST_SHARPNESS, 4.0, 40.0] {
            for (u, end) in [(-MAX_WARP, 0.0), (MAX_WARP, 1.0)] {
                let stroke = plain_stroke(u, sharpness);
                assert_eq!(stroke.value, [end, 0.0, 0.0, 0.0, 0.0]);
                assert_eq!(stroke.by_sharpness, [0.0; 4]);
            }
        }
    }

    /// A sharp stroke is close to that of the paper: near its middle φ = ωt (1 + u² + ..), and ωt = 8 is at u = 8/κ, so
    /// that the relative change of φ is (8/κ)².
    #[test]
    fn large_sharpness_is_the_papers_stroke() {
        let stroke = LogisticStroke { amplitude: 2.0, centre_s: 0.0, half_duration_s: 1e5, sharpness: 1e5 };
        for time in [-8.0_f64, -2.0, 0.0, 1.0, 5.0] {
            let gone = 2.0 / (1.0 + (-time).exp());
            let [q, dq, ddq, _] = stroke.derivatives_by_shape(time).map(|row| 2.0 * row[0]);
            assert!((q - gone).abs() < 1e-7);
            assert!((dq - 0.5 * gone * (2.0 - gone)).abs() < 1e-7);
            assert!((ddq - 0.25 * gone * (2.0 - gone) * (2.0 - 2.0 * gone)).abs() < 1e-7);
        }
    }

    proptest! {
        /// Dual numbers through the same arithmetic: the derivative of each order is the next order, and that by κ is
        /// ∂/∂κ. Tolerance 1e-11 of the sizes that Taylor coefficients reach near the ends of the window.
        #[test]
        fn orders_derive_each_other(u in -0.97_f64..0.97, sharpness in 3.4642_f64..30.0) {
            let plain = plain_stroke(u, sharpness);
            let by_u = dual_stroke(Dual::variable(u), Dual::constant(sharpness));
            let by_k = dual_stroke(Dual::constant(u), Dual::variable(sharpness));
            let size = |order: usize| sharpness.max(4.0).powi(order as i32) * 1e3;
            for order in 0..4 {
                prop_assert!((by_u.value[order].derivative - plain.value[order + 1]).abs() < 1e-12 * size(order + 1));
                prop_assert!((by_k.value[order].derivative - plain.by_sharpness[order]).abs() < 1e-12 * size(order));
            }
        }
    }
}
