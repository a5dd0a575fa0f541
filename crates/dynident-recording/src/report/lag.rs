//! Estimation of the lag between two signals.

use serde::{Deserialize, Serialize};

/// The time shift with the maximum correlation between two signals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Lag {
    /// Time by which the second signal is later than the first, s; negative if it is earlier.
    pub seconds: f64,
    /// Lag in samples, interpolated by a parabola through the three best correlations.
    pub samples: f64,
    /// Correlation with this shift, -1 to 1, which has the largest magnitude; negative if the second signal is
    /// reversed.
    pub correlation: f64,
    /// Correlation without a shift.
    pub correlation_unshifted: f64,
    /// Whether the maximum is at the limit of the search. The true lag may then be longer, or undefined.
    pub at_limit: bool,
}

/// Lag of the signal `b` behind the signal `a`, searched up to `max_lag_samples` in both directions. It is the shift
/// `k` with the maximum `|corr(a[i], b[i + k])|` (Pearson's correlation, the same samples of `a` for every shift),
/// refined by a parabola. `None` for signals that are constant, not finite, or shorter than three times the maximum
/// lag. Both signals must have passed the same filter.
pub fn best_lag(a: &[f64], b: &[f64], max_lag_samples: usize, rate_hz: f64) -> Option<Lag> {
    let n = a.len().min(b.len());
    if n < 3 * max_lag_samples.max(1) || !(rate_hz.is_finite() && rate_hz > 0.0) {
        return None;
    }
    let limit = max_lag_samples as isize;
    let still = &a[max_lag_samples..n - max_lag_samples];
    let mut correlations = Vec::with_capacity(2 * max_lag_samples + 1);
    for first in (0..=2 * max_lag_samples).step_by(PARALLEL_LAGS) {
        let lags = PARALLEL_LAGS.min(2 * max_lag_samples + 1 - first);
        correlations.extend_from_slice(&correlations_from(still, &b[first..n])[..lags]);
    }
    if !correlations.iter().all(|correlation| correlation.is_finite()) {
        return None;
    }
    let best = (0..correlations.len()).max_by(|x, y| correlations[*x].abs().total_cmp(&correlations[*y].abs()))?;
    let peak = correlations[best];
    let mut samples = (best as isize - limit) as f64;
    if best > 0 && best + 1 < correlations.len() {
        let (before, after) = (correlations[best - 1], correlations[best + 1]);
        let curvature = before - 2.0 * peak + after;
        if curvature != 0.0 {
            samples += (0.5 * (before - after) / curvature).clamp(-0.5, 0.5);
        }
    }
    Some(Lag {
        seconds: samples / rate_hz,
        samples,
        correlation: peak,
        correlation_unshifted: correlations[max_lag_samples],
        at_limit: best == 0 || best + 1 == correlations.len(),
    })
}

impl Lag {
    /// Whether the lag is significant: the shift explains at least half of the difference between the signals. Slow
    /// signals agree with any small shift, so their best shift has no meaning.
    pub fn matters(&self) -> bool {
        let unexplained = |correlation: f64| 1.0 - correlation * correlation;
        !self.at_limit && unexplained(self.correlation) < 0.5 * unexplained(self.correlation_unshifted)
    }
}

const PARALLEL_LAGS: usize = 8;

/// Pearson's correlation of `a` with `b` from sample 0, 1, 2, ... of `b` on. The value is not finite if a signal is
/// constant or not finite, and meaningless if `b` is too short. The compiler vectorises the loops over lags; the order
/// of summation for each lag is fixed.
fn correlations_from(a: &[f64], b: &[f64]) -> [f64; PARALLEL_LAGS] {
    let n = a.len() as f64;
    let mut padded = b.to_vec();
    padded.resize(a.len() + PARALLEL_LAGS - 1, 0.0);
    let mean_a = a.iter().sum::<f64>() / n;
    let mut mean_b = [0.0; PARALLEL_LAGS];
    for b in padded.windows(PARALLEL_LAGS) {
        for k in 0..PARALLEL_LAGS {
            mean_b[k] += b[k];
        }
    }
    let mean_b = mean_b.map(|sum| sum / n);
    let (mut aa, mut bb, mut ab) = (0.0, [0.0; PARALLEL_LAGS], [0.0; PARALLEL_LAGS]);
    for (a, b) in a.iter().zip(padded.windows(PARALLEL_LAGS)) {
        let a = a - mean_a;
        aa += a * a;
        for k in 0..PARALLEL_LAGS {
            let b = b[k] - mean_b[k];
            bb[k] += b * b;
            ab[k] += a * b;
        }
    }
    core::array::from_fn(|k| ab[k] / (aa.sqrt() * bb[k].sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_between_samples_is_found_with_its_sign() {
        let signal = |t: f64| (t * 3.0).sin() + 0.5 * (t * 7.1).cos();
        let rate = 100.0;
        let a: Vec<f64> = (0..1000).map(|i| signal(f64::from(i) / rate)).collect();
        for (shift, sign) in [(0.0234, 1.0), (-0.05, -1.0), (0.0, 1.0)] {
            let b: Vec<f64> = (0..1000).map(|i| sign * signal(f64::from(i) / rate - shift)).collect();
            let lag = best_lag(&a, &b, 20, rate).unwrap();
            // The error of the parabola at a smooth peak is a few thousandths of a sample.
            assert!((lag.seconds - shift).abs() < 2e-4, "{lag:?}");
            assert!((lag.correlation - sign).abs() < 1e-3, "{lag:?}");
        }
    }

    #[test]
    fn dead_or_short_signals_have_no_lag() {
        assert!(best_lag(&[1.0; 100], &[0.0; 100], 10, 1.0).is_none());
        assert!(best_lag(&[1.0, 2.0], &[1.0, 2.0], 10, 1.0).is_none());
        assert!(best_lag(&[], &[], 0, 1.0).is_none());
    }
}
