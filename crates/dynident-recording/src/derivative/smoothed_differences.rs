//! Differentiator with central differences and a smoothed acceleration.

use super::central_differences::CentralDifferences;
use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::{FilterError, require};

/// Central differences of the logged positions. A moving average of `window` samples smooths the acceleration, and also
/// the torque if `smooth_torque` is set. Position and velocity are not smoothed.
///
/// White position noise σ causes a standard deviation of `σ rate/√2` in dq (order 2). The average of second differences
/// over W samples is the difference of two slopes, so the standard deviation in ddq is `2 σ rate²/W` for 2 <= W,
/// compared with `√6 σ rate²` without the average. The average reduces the acceleration by `(W² - 1)/(24 rate²)` times
/// its second derivative. Near the ends, the window is shorter but remains centred. Source: Xu et al., as cited in
/// *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*.
#[derive(Clone, Debug, PartialEq)]
pub struct SmoothedDifferences {
    differences: CentralDifferences,
    order: usize,
    window: usize,
}

impl SmoothedDifferences {
    /// Creates differences of accuracy `order`, with the acceleration averaged over `window` samples.
    ///
    /// # Errors
    /// If `order` is not 2, 4, 6 or 8, or `window` is even or beyond 501.
    pub fn new(order: usize, window: usize) -> Result<Self, FilterError> {
        let fix = "give an odd number, 3 to 501";
        require(window % 2 == 1 && (3..=501).contains(&window), "window", window as f64, fix)?;
        Ok(Self { differences: CentralDifferences::new(order)?, order, window })
    }
}

impl Differentiator for SmoothedDifferences {
    fn name(&self) -> &'static str {
        "smoothed-differences"
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        Some(self.order + self.window)
    }

    fn minimum_samples(&self) -> usize {
        (self.order + 1).max(self.window)
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let rate_hz = place.rate_hz;
        self.check_length(q.len())?;
        let mut rough = vec![0.0; q.len()];
        self.differences.differentiate(rate_hz, q, Derivatives { q: out.q, dq: out.dq, ddq: &mut rough })?;
        moving_average(&rough, self.window, out.ddq);
        Ok(Vec::new())
    }

    fn smooth(&self, _rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.check_length(signal.len())?;
        moving_average(signal, self.window, out);
        Ok(())
    }
}

/// Mean of `window` samples around each sample; near the ends of fewer samples, still centred.
fn moving_average(signal: &[f64], window: usize, out: &mut [f64]) {
    let n = signal.len();
    for (i, out) in out.iter_mut().enumerate().take(n) {
        let half = (window / 2).min(i).min(n - 1 - i);
        let points = &signal[i - half..=i + half];
        *out = points.iter().sum::<f64>() / points.len() as f64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{differentiated, normal, rms};

    #[test]
    fn noise_reduction_follows_the_closed_form() {
        let (rate, n) = (100.0, 40_000);
        for window in [3_usize, 11, 51] {
            let out = differentiated(&SmoothedDifferences::new(2, window).unwrap(), rate, &normal(7, n));
            // 40 000 samples, correlated over the window: one standard deviation is at most √(51/80 000) = 2.5 %; four
            // are allowed.
            let expected = 2.0 * rate * rate / window as f64;
            let inside = &out[2][window..n - window];
            assert!((rms(inside) / expected - 1.0).abs() < 0.1, "{window}: {} {expected}", rms(inside));
            assert!((rms(&out[1]) / (rate / core::f64::consts::SQRT_2) - 1.0).abs() < 0.03);
        }
    }

    #[test]
    fn a_cubic_is_differentiated_exactly_and_a_sine_with_the_gain_of_the_average() {
        let (rate, n, window) = (100.0, 300_usize, 21_usize);
        let differentiator = SmoothedDifferences::new(4, window).unwrap();
        let t = |i: usize| i as f64 / rate;
        let out = differentiated(&differentiator, rate, &(0..n).map(|i| t(i).powi(3)).collect::<Vec<_>>());
        for i in 0..n {
            // Rounding: positions of 27 to 1e-16, times rate² and the weights, whose absolute sum is 30 at the ends.
            assert!((out[2][i] - 6.0 * t(i)).abs() < 1e-8, "{i}");
        }
        let w = 3.0;
        let out = differentiated(&differentiator, rate, &(0..n).map(|i| (w * t(i)).sin()).collect::<Vec<_>>());
        // The mean of W samples of a sine has the gain of Dirichlet's kernel.
        let x = 0.5 * w / rate;
        let gain = (window as f64 * x).sin() / (window as f64 * x.sin());
        for i in 20..n - 20 {
            // Differences of fourth order: (ωh)⁴/90 = 9e-9 of the acceleration.
            assert!((out[2][i] + gain * w * w * (w * t(i)).sin()).abs() < 1e-7, "{i}");
        }
    }

    #[test]
    fn bad_settings_are_refused() {
        assert!(SmoothedDifferences::new(2, 4).is_err());
        assert!(SmoothedDifferences::new(2, 503).is_err());
        assert!(SmoothedDifferences::new(3, 5).is_err());
        let differentiator = SmoothedDifferences::new(2, 11).unwrap();
        assert!(differentiator.smooth(1.0, &[0.0; 10], &mut [0.0; 10]).is_err());
    }
}
