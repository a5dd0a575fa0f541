//! By how much one signal comes after another.

use serde::{Deserialize, Serialize};

/// The shift at which two signals match best.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lag {
    /// Seconds by which the second signal comes after the first; negative if before.
    pub seconds: f64,
    /// The same in samples, between samples by a parabola through the three best correlations.
    pub samples: f64,
    /// Correlation there, -1 to 1: the one of largest magnitude; negative if the second signal is reversed.
    pub correlation: f64,
    /// Correlation without a shift.
    pub correlation_unshifted: f64,
    /// Whether the largest correlation was found at the end of the search: the true lag may be longer, or there is
    /// none.
    pub at_limit: bool,
}

/// The lag of `b` behind `a`, searched up to `max_lag_samples` either way: the shift `k` of largest `|corr(a[i], b[i +
/// k])|` (Pearson's correlation, the same samples of `a` for every shift), refined by a parabola. `None` for signals
/// that are constant, not finite, or not at least three times as long as the largest lag. Filter both signals alike
/// before.
pub fn best_lag(a: &[f64], b: &[f64], max_lag_samples: usize, rate_hz: f64) -> Option<Lag> {
    let n = a.len().min(b.len());
    if n < 3 * max_lag_samples.max(1) || !(rate_hz.is_finite() && rate_hz > 0.0) {
        return None;
    }
    let limit = max_lag_samples as isize;
    let correlations = (-limit..=limit)
        .map(|lag| {
            let from = max_lag_samples.wrapping_add_signed(lag);
            correlation(&a[max_lag_samples..n - max_lag_samples], &b[from..n - 2 * max_lag_samples + from])
        })
        .collect::<Option<Vec<f64>>>()?;
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
    /// Whether shifting explains at least half of what differs between the signals: slow signals match at any small
    /// shift, and then the best one means nothing.
    pub fn matters(&self) -> bool {
        let unexplained = |correlation: f64| 1.0 - correlation * correlation;
        !self.at_limit && unexplained(self.correlation) < 0.5 * unexplained(self.correlation_unshifted)
    }
}

/// Pearson's correlation; `None` if a signal is constant or not finite.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let n = a.len() as f64;
    let (mean_a, mean_b) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    let value = ab / (aa.sqrt() * bb.sqrt());
    value.is_finite().then_some(value)
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
            // The parabola misses a smooth peak by a few thousandths of a sample.
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
