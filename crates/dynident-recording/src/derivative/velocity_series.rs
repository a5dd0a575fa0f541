//! Differentiator that fits a Fourier series to the filtered velocity.

use super::butterworth::ButterworthZeroPhase;
use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use super::harmonic_fit::{HarmonicFit, check_series};
use crate::error::FilterError;

/// Filters q and dq with a zero-phase Butterworth filter of order 4. Then it fits a Fourier series (offset and
/// harmonics 1 to K of `base_hz`) to the filtered dq over the whole piece. The result is the filtered q, the series for
/// dq, and the derivative of the series for ddq.
///
/// The result is exact for a periodic motion that the series can represent and that is well below the cut-off. For N
/// samples, the fit passes `√((2K + 1)/N)` of white noise. The noise of a filtered difference is smaller at the low
/// frequencies of the series, so the noise of ddq is about that of [`FourierFit`](super::FourierFit). Source: Feng et
/// al., as cited in *Iterative Identification of Robot Dynamic Parameters Based on Logistic Function*.
#[derive(Clone, Debug, PartialEq)]
pub struct VelocitySeries {
    base_hz: f64,
    harmonics: usize,
    filter: ButterworthZeroPhase,
}

impl VelocitySeries {
    /// Creates a fit with `harmonics` harmonics of `base_hz` for velocities that are filtered with the cut-off
    /// `cutoff_hz`.
    ///
    /// # Errors
    /// If a frequency is not positive or the harmonics are not 1 to 200.
    pub fn new(base_hz: f64, harmonics: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        check_series(base_hz, harmonics)?;
        Ok(Self { base_hz, harmonics, filter: ButterworthZeroPhase::new(4, cutoff_hz)? })
    }
}

impl Differentiator for VelocitySeries {
    fn name(&self) -> &'static str {
        "speed-series"
    }

    fn minimum_samples(&self) -> usize {
        self.filter.minimum_samples().max(2 * self.harmonics + 2)
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let rate_hz = place.rate_hz;
        let n = q.len();
        self.check_length(n)?;
        self.filter.differentiate(rate_hz, q, Derivatives { q: out.q, dq: &mut *out.dq, ddq: &mut *out.ddq })?;
        let fit = HarmonicFit::new(self.name(), self.base_hz, self.harmonics, false, rate_hz, &out.dq[..n])?;
        for i in 0..n {
            [out.dq[i], out.ddq[i], _] = fit.at(i);
        }
        Ok(Vec::new())
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.filter.smooth(rate_hz, signal, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::differentiated;
    use core::f64::consts::TAU;

    #[test]
    fn a_series_is_multiplied_by_the_gain_of_the_filter() {
        let (rate, base, cutoff, n) = (200.0, 0.5, 10.0, 4000_usize);
        let q: Vec<f64> = (0..n)
            .map(|i| {
                let x = TAU * base * i as f64 / rate;
                x.sin() + 0.3 * (3.0 * x).cos()
            })
            .collect();
        let out = differentiated(&VelocitySeries::new(base, 3, cutoff).unwrap(), rate, &q);
        let warp = |f: f64| (core::f64::consts::PI * f / rate).tan();
        let gain = |f: f64| 1.0 / (1.0 + (warp(f) / warp(cutoff)).powi(8));
        let w = TAU * base;
        for i in 0..n {
            let x = w * i as f64 / rate;
            let dq = w * (gain(base) * x.cos() - 0.9 * gain(3.0 * base) * (3.0 * x).sin());
            let ddq = -w * w * (gain(base) * x.sin() + 2.7 * gain(3.0 * base) * (3.0 * x).cos());
            // The transients at the two ends (some tenths of a second of 20 s) change the fit by at most a thousandth
            // of the velocity.
            assert!((out[1][i] - dq).abs() < 2e-3 * w && (out[2][i] - ddq).abs() < 6e-3 * w * w, "{i}");
        }
    }

    #[test]
    fn bad_settings_are_refused() {
        assert!(VelocitySeries::new(0.0, 3, 1.0).is_err());
        assert!(VelocitySeries::new(1.0, 0, 1.0).is_err());
        assert!(VelocitySeries::new(1.0, 3, -1.0).is_err());
        let differentiator = VelocitySeries::new(1.0, 20, 1.0).unwrap();
        let mut out = [vec![0.0; 30], vec![0.0; 30], vec![0.0; 30]];
        let [y, dy, ddy] = &mut out;
        assert!(differentiator.differentiate(10.0, &[0.0; 30], Derivatives { q: y, dq: dy, ddq: ddy }).is_err());
    }
}
