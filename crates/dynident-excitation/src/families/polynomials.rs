//! Polynomial pieces shared by several families.

/// Polynomial 35x⁴ - 84x⁵ + 70x⁶ - 20x⁷ that rises from 0 to 1, with three derivatives that are zero at both ends;
/// constant outside 0..1. Also returns its first three derivatives with respect to x.
pub(crate) fn smooth_step(x: f64) -> [f64; 4] {
    if x <= 0.0 {
        return [0.0; 4];
    }
    if x >= 1.0 {
        return [1.0, 0.0, 0.0, 0.0];
    }
    let (y, z) = (1.0 - x, x * (1.0 - x));
    [
        x.powi(4) * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x))),
        140.0 * z * z * z,
        420.0 * z * z * (y - x),
        840.0 * z * (1.0 - 5.0 * z),
    ]
}

/// The integral of [`smooth_step`] from 0, with its first three derivatives; x - 1/2 beyond 1.
pub(crate) fn smooth_ramp(x: f64) -> [f64; 4] {
    let [step, first, second, _] = smooth_step(x);
    let ramp = if x <= 0.0 {
        0.0
    } else if x >= 1.0 {
        x - 0.5
    } else {
        x.powi(5) * (7.0 + x * (-14.0 + x * (10.0 - 2.5 * x)))
    };
    [ramp, step, first, second]
}

/// The six quintic Hermite functions on 0..`span_s` at `time_s`, with their first three time derivatives: weights of
/// q, q̇, q̈ at the start, then of q, q̇, q̈ at the end.
///
/// # Source
/// Quintic polynomial with given position, velocity and acceleration at both ends; Craig, Introduction to Robotics,
/// section 7.3.
pub(crate) fn quintic_hermite(time_s: f64, span_s: f64) -> [[f64; 4]; 6] {
    const START: [[f64; 6]; 3] =
        [[1.0, 0.0, 0.0, -10.0, 15.0, -6.0], [0.0, 1.0, 0.0, -6.0, 8.0, -3.0], [0.0, 0.0, 0.5, -1.5, 1.5, -0.5]];
    // Each end is computed from its own side, so that the values at both ends are exact.
    let at = |x: f64, sign: f64| -> [[f64; 4]; 3] {
        core::array::from_fn(|end_order| {
            let mut falling = START[end_order];
            core::array::from_fn(|order| {
                let value = falling.iter().rev().fold(0.0, |sum, c| sum * x + c);
                for power in 0..5 {
                    falling[power] = falling[power + 1] * (power + 1) as f64;
                }
                falling[5] = 0.0;
                let flip = if (order + end_order) % 2 == 1 { sign } else { 1.0 };
                flip * value * span_s.powi(end_order as i32 - order as i32)
            })
        })
    };
    let x = (time_s / span_s).clamp(0.0, 1.0);
    let (start, end) = (at(x, 1.0), at(1.0 - x, -1.0));
    [start[0], start[1], start[2], end[0], end[1], end[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_lanes::{Dual, Scalar};

    /// Horner's rule on dual numbers with the polynomial written in powers, an independent computation of each
    /// derivative (1e-12: sums of terms below 1e3).
    #[test]
    fn step_and_ramp_derive_each_other() {
        for sample in 1..40 {
            let x = f64::from(sample) / 40.0;
            let dual = Dual::variable(x);
            let step = [0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0]
                .iter()
                .rev()
                .fold(Dual::ZERO, |sum, &c| sum * dual + Dual::constant(c));
            let got = smooth_step(x);
            assert!((step.value - got[0]).abs() < 1e-12 && (step.derivative - got[1]).abs() < 1e-12);
            let z = dual * (Dual::ONE - dual);
            let first = z * z * z * Dual::splat(140.0);
            assert!((first.derivative - got[2]).abs() < 1e-12);
            let second = z * z * (Dual::ONE - dual - dual) * Dual::splat(420.0);
            assert!((second.derivative - got[3]).abs() < 1e-11);
            let ramp = [0.0, 0.0, 0.0, 0.0, 0.0, 7.0, -14.0, 10.0, -2.5]
                .iter()
                .rev()
                .fold(Dual::ZERO, |sum, &c| sum * dual + Dual::constant(c));
            let got = smooth_ramp(x);
            assert!((ramp.value - got[0]).abs() < 1e-12 && (ramp.derivative - got[1]).abs() < 1e-12);
        }
        assert_eq!(smooth_ramp(1.0)[0], 0.5);
    }

    /// Each function has only its own end value, and the six reproduce t⁵ (1e-12).
    #[test]
    fn hermite_interpolates() {
        let span = 1.7;
        let (start, end) = (quintic_hermite(0.0, span), quintic_hermite(span, span));
        for function in 0..6 {
            for order in 0..3 {
                assert_eq!(start[function][order], f64::from(u8::from(function == order)));
                assert_eq!(end[function][order], f64::from(u8::from(function == 3 + order)));
            }
        }
        let power = |t: f64| [t.powi(5), 5.0 * t.powi(4), 20.0 * t.powi(3), 60.0 * t * t];
        let ends = power(span);
        for t in [0.2, 0.9, 1.6] {
            let functions = quintic_hermite(t, span);
            for order in 0..4 {
                let value: f64 = (0..3).map(|n| ends[n] * functions[3 + n][order]).sum();
                assert!((value - power(t)[order]).abs() < 1e-11);
            }
        }
    }
}
