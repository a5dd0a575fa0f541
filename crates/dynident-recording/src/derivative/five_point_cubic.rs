//! Differentiator with a five-point cubic smoothing of the torque and low-pass filtered differences of the position.

use super::butterworth::ButterworthZeroPhase;
use super::central_differences::CentralDifferences;
use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use super::savitzky_golay::SavitzkyGolay;
use crate::error::{FilterError, require};

/// Torque ([`smooth`](Differentiator::smooth)): smoothed `passes` times by the least-squares cubic on five points, with
/// the weights `(-3, 12, 17, 12, -3)/35`; at the ends, the values of the first and last cubic. Position: a zero-phase
/// Butterworth filter of order 4 for q, dq and ddq; dq and ddq are central differences of second order.
///
/// One pass has the gain `(17 + 24 cos ω - 6 cos 2ω)/35` at the frequency ω (rad per sample), which is 1 - 3ω⁴/35 for
/// slow signals. The first pass reduces white noise to √(17/35) = 0.70 of its standard deviation. Source: Zhang et al.,
/// as cited in *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*, for the combination
/// (they do not state the phase of the low-pass); Savitzky and Golay, Anal. Chem. 36 (1964) 1627, table I, for the
/// weights.
#[derive(Clone, Debug, PartialEq)]
pub struct FivePointCubic {
    cubic: SavitzkyGolay,
    passes: usize,
    differences: CentralDifferences,
    low_pass: ButterworthZeroPhase,
}

impl FivePointCubic {
    /// Creates a smoother with `passes` passes over the torque and `cutoff_hz` for the derivatives.
    ///
    /// # Errors
    /// If `passes` is not 1 to 1000 or the cut-off is not positive.
    pub fn new(passes: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        require((1..=1000).contains(&passes), "passes", passes as f64, "give 1 to 1000")?;
        Ok(Self {
            cubic: SavitzkyGolay::new(5, 3)?,
            passes,
            differences: CentralDifferences::new(2)?,
            low_pass: ButterworthZeroPhase::new(4, cutoff_hz)?,
        })
    }
}

impl Differentiator for FivePointCubic {
    fn name(&self) -> &'static str {
        "five-point-cubic"
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        let low_pass = self.low_pass.context_samples(rate_hz)?;
        Some((low_pass + 2).max(5 * self.passes))
    }

    fn minimum_samples(&self) -> usize {
        self.low_pass.minimum_samples().max(5)
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        // The filter is applied first. Because of linearity, this is equivalent inside the signal; at the ends, the
        // filter would otherwise start from a noisy difference.
        let mut filtered = vec![0.0; q.len()];
        self.low_pass.smooth(place.rate_hz, q, &mut filtered)?;
        self.differences.differentiate_at(place, &filtered, out)
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let n = signal.len();
        self.check_length(n)?;
        let mut from = signal.to_vec();
        for _ in 0..self.passes {
            self.cubic.smooth(rate_hz, &from, out)?;
            from.copy_from_slice(&out[..n]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{differentiated, normal, rms};

    #[test]
    fn passes_have_the_gain_of_the_cosine_formula() {
        let n = 400;
        let mut out = vec![0.0; n];
        for (omega, passes) in [(0.05_f64, 1_usize), (0.8, 3), (2.0, 20)] {
            let signal: Vec<f64> = (0..n).map(|i| (omega * f64::from(i as u32)).cos()).collect();
            FivePointCubic::new(passes, 1.0).unwrap().smooth(100.0, &signal, &mut out).unwrap();
            let gain = ((17.0 + 24.0 * omega.cos() - 6.0 * (2.0 * omega).cos()) / 35.0).powi(passes as i32);
            for i in 100..300 {
                assert!((out[i] - gain * signal[i]).abs() < 1e-13, "{omega} {i}");
            }
        }
        let noise = normal(5, 40_000);
        let mut out = vec![0.0; noise.len()];
        FivePointCubic::new(1, 1.0).unwrap().smooth(100.0, &noise, &mut out).unwrap();
        // One standard deviation of the ratio is below √(2/40 000) = 0.7 %.
        assert!((rms(&out) / (17.0_f64 / 35.0).sqrt() - 1.0).abs() < 0.03);
    }

    #[test]
    fn derivatives_have_the_gains_of_differences_and_filter() {
        let (rate, cutoff, n) = (200.0, 8.0, 2000_usize);
        let w = core::f64::consts::TAU * 3.0;
        let q: Vec<f64> = (0..n).map(|i| (w * i as f64 / rate).sin()).collect();
        let out = differentiated(&FivePointCubic::new(2, cutoff).unwrap(), rate, &q);
        let warp = |f: f64| (core::f64::consts::PI * f / rate).tan();
        let filter = 1.0 / (1.0 + (warp(3.0) / warp(cutoff)).powi(8));
        let h = w / rate;
        for i in 600..1400 {
            let (sin, cos) = (h * i as f64).sin_cos();
            // The tolerance covers rounding in the recursion.
            assert!((out[1][i] - filter * rate * h.sin() * cos).abs() < 1e-8 * w, "{i}");
            assert!((out[2][i] + filter * rate * rate * 2.0 * (1.0 - h.cos()) * sin).abs() < 1e-8 * w * w, "{i}");
        }
    }

    #[test]
    fn bad_settings_are_refused() {
        assert!(FivePointCubic::new(0, 1.0).is_err());
        assert!(FivePointCubic::new(1, 0.0).is_err());
        let differentiator = FivePointCubic::new(1, 1.0).unwrap();
        assert!(differentiator.smooth(10.0, &[0.0; 4], &mut [0.0; 4]).is_err());
    }
}
