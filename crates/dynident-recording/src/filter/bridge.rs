//! Smooth transition (bridge) from the end of a piece to its start, so that the piece can be repeated without a jump.

use super::orthonormal::{half, orthonormal_polynomials};

/// Degree of the polynomials that are fitted at the ends.
const DEGREE: usize = 4;

/// Minimum number of samples for the polynomial fit at an end.
pub(crate) const MIN_END_SAMPLES: usize = 2 * (DEGREE + 1);

/// Value, first and second derivative (per sample) of the polynomial that was fitted to `signal`, at the sample
/// `place`.
fn state(signal: &[f64], basis: &[[Vec<f64>; 3]], place: usize) -> [f64; 3] {
    let origin = signal[place];
    let mut state = [origin, 0.0, 0.0];
    for polynomial in basis {
        let share: f64 = polynomial[0].iter().zip(signal).map(|(p, x)| p * (x - origin)).sum();
        for (derivative, state) in state.iter_mut().enumerate() {
            *state += share * polynomial[derivative][place] / half(signal.len()).powi(derivative as i32);
        }
    }
    state
}

/// The `steps - 1` samples of a transition in `steps` steps from the end of the signal back to its start. It is the
/// quintic polynomial with the value, velocity and acceleration of both ends, which are estimated by polynomials of
/// degree 4 through `window` samples. The repeated extended signal is continuous up to the second derivative.
pub(crate) fn bridge(signal: &[f64], window: usize, steps: usize) -> Vec<f64> {
    let basis = orthonormal_polynomials(window, DEGREE);
    let [from, v0, a0] = state(&signal[signal.len() - window..], &basis, window - 1);
    let [to, v1, a1] = state(&signal[..window], &basis, 0);
    let length = steps as f64;
    let (c1, c2) = (v0 * length, 0.5 * a0 * length * length);
    // Value, slope and curvature that remain to be reached at the far end.
    let (rise, slope, curvature) = (to - from - c1 - c2, v1 * length - c1 - 2.0 * c2, a1 * length * length - 2.0 * c2);
    let c3 = 10.0 * rise - 4.0 * slope + 0.5 * curvature;
    let c4 = -15.0 * rise + 7.0 * slope - curvature;
    let c5 = 6.0 * rise - 3.0 * slope + 0.5 * curvature;
    (1..steps)
        .map(|step| {
            let s = step as f64 / length;
            from + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fit of a quartic is exact: the extended signal is smooth to the third difference at both seams.
    #[test]
    fn the_bridge_meets_both_ends_up_to_the_second_derivative() {
        let n = 200;
        let at = |i: usize| {
            let x = i as f64 / n as f64;
            3.0 + x * (2.0 - x * (5.0 - x * (4.0 - 1.5 * x)))
        };
        let signal: Vec<f64> = (0..n).map(at).collect();
        let whole: Vec<f64> = signal.iter().copied().chain(bridge(&signal, 40, 100)).collect();
        let round = |i: usize| whole[i % whole.len()];
        for i in 0..whole.len() {
            let third = round(i + 3) - 3.0 * round(i + 2) + 3.0 * round(i + 1) - round(i);
            // Third derivatives of a few units over 1/200 and 1/100: 60 c / steps³, c below 30. A jump of the second
            // derivative by 1 would be 2.5e-5, of the first 5e-3.
            assert!(third.abs() < 6e-5, "{i}: {third}");
            let second = round(i + 2) - 2.0 * round(i + 1) + round(i);
            assert!(second.abs() < 5e-3, "{i}: {second}");
        }
    }
}
