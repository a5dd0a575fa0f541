//! Local cubics are exact for cubics, and have the theoretical variance for noise.

use dynident_model::sample::Random;
use dynident_online::{DelayedDerivatives, OnlineError};

#[test]
fn cubics_come_back_exactly_in_the_middle_of_the_window() {
    let (rate_hz, half) = (125.0, 7);
    let mut derivatives = DelayedDerivatives::new(2, rate_hz, half).unwrap();
    let at = |t: f64| {
        let one = [0.3 - 1.2 * t + 0.7 * t * t - 2.0 * t.powi(3), -1.2 + 1.4 * t - 6.0 * t * t, 1.4 - 12.0 * t];
        [one, one.map(|value| -2.0 * value)]
    };
    for sample in 0..60_u32 {
        let t = f64::from(sample) / rate_hz;
        let [a, b] = at(t);
        let found = derivatives.add(&[a[0], b[0]], &[t, -t]).unwrap().cloned();
        assert_eq!(found.is_some(), sample as usize >= 2 * half);
        let Some(found) = found else { continue };
        let then = t - half as f64 / rate_hz;
        let expected = at(then);
        for joint in 0..2 {
            let [q, dq, ddq] = expected[joint];
            // Sums of fifteen numbers; accelerations are multiplied by the squared rate.
            assert!((found.q[joint] - q).abs() < 1e-12);
            assert!((found.dq[joint] - dq).abs() < 1e-10);
            assert!((found.ddq[joint] - ddq).abs() < 1e-7);
        }
        assert_eq!(found.tau, [then, -then].map(|tau| found.tau[0].abs().copysign(tau)));
        assert!((found.tau[0] - then).abs() < 1e-12);
    }
    assert_eq!(derivatives.delay_samples(), half);
    derivatives.restart();
    assert!(derivatives.add(&[0.0, 0.0], &[0.0, 0.0]).unwrap().is_none());
}

/// The variance of a slope of a quadratic over 2m + 1 white samples is a lower bound for that of the cubic.
#[test]
fn noise_variance_follows_from_the_weights() {
    let (rate_hz, half, sigma) = (500.0, 10, 1e-4);
    let mut derivatives = DelayedDerivatives::new(1, rate_hz, half).unwrap();
    let mut random = Random::new(3);
    let (mut squares, mut count) = (0.0, 0);
    for _ in 0..200_000 {
        let noise: f64 = (0..12).map(|_| random.uniform(-0.5, 0.5)).sum();
        if let Some(found) = derivatives.add(&[sigma * noise], &[0.0]).unwrap() {
            squares += found.ddq[0] * found.ddq[0];
            count += 1;
        }
    }
    // σ² T⁻⁴ · 180 / (n (n² − 1)(n² − 4)) · 4 with n = 2m + 1 (Savitzky-Golay, second derivative of degree 2 and 3).
    let n = 2.0 * half as f64 + 1.0;
    let expected = sigma * rate_hz * rate_hz * (720.0 / (n * (n * n - 1.0) * (n * n - 4.0))).sqrt();
    let found = (squares / f64::from(count)).sqrt();
    // The relative scatter of 10,000 independent windows is below 1 %.
    assert!((found / expected - 1.0).abs() < 0.03, "{found} and {expected}");
}

#[test]
fn invalid_input_is_refused() {
    assert!(matches!(DelayedDerivatives::new(2, 0.0, 5), Err(OnlineError::Number { .. })));
    assert!(matches!(DelayedDerivatives::new(2, 100.0, 1), Err(OnlineError::Number { .. })));
    let mut derivatives = DelayedDerivatives::new(2, 100.0, 2).unwrap();
    assert!(matches!(derivatives.add(&[0.0], &[0.0, 0.0]), Err(OnlineError::Length { .. })));
    assert!(matches!(derivatives.add(&[0.0, f64::NAN], &[0.0, 0.0]), Err(OnlineError::Number { .. })));
}
