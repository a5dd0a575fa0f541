//! Differentiator that fits a Fourier series to the positions in the time domain.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use super::harmonic_fit::{HarmonicFit, check_series};
use crate::error::FilterError;

/// Fits an offset, an optional straight line and the harmonics 1 to K of the base frequency f (`base_hz`) to the whole
/// piece by least squares. Position, velocity and acceleration are those of the series, so they are exact for a motion
/// that the series can represent:
///
/// `q(t) = c + d t + Σ_k a_k sin(2π k f t) + b_k cos(2π k f t)`
///
/// Noise of standard deviation σ in N samples over whole periods causes a standard deviation of `σ √((2K + 1)/N)` in q,
/// `σ √(2 Σ (2πkf)²/N)` in dq and `σ √(2 Σ (2πkf)⁴/N)` in ddq. Motion that the series cannot represent causes bias:
/// tracking errors at other frequencies, and transients before the motion repeats. Source: Swevers, Ganseman, Tükel, de
/// Schutter, van Brussel, IEEE Trans. Robot. Autom. 13 (1997) 730.
#[derive(Clone, Debug, PartialEq)]
pub struct FourierFit {
    base_hz: f64,
    harmonics: usize,
    trend: bool,
}

impl FourierFit {
    /// Creates a fit with `harmonics` harmonics of `base_hz`, and with a straight line if `trend` is true.
    ///
    /// # Errors
    /// If the base frequency is not positive or the harmonics are not 1 to 200.
    pub fn new(base_hz: f64, harmonics: usize, trend: bool) -> Result<Self, FilterError> {
        check_series(base_hz, harmonics)?;
        Ok(Self { base_hz, harmonics, trend })
    }

    fn fit(&self, rate_hz: f64, signal: &[f64]) -> Result<HarmonicFit, FilterError> {
        self.check_length(signal.len())?;
        HarmonicFit::new(self.name(), self.base_hz, self.harmonics, self.trend, rate_hz, signal)
    }
}

impl Differentiator for FourierFit {
    fn name(&self) -> &'static str {
        "fourier-fit"
    }

    fn minimum_samples(&self) -> usize {
        2 * self.harmonics + 2 + usize::from(self.trend)
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let rate_hz = place.rate_hz;
        let fit = self.fit(rate_hz, q)?;
        for i in 0..q.len() {
            [out.q[i], out.dq[i], out.ddq[i]] = fit.at(i);
        }
        Ok(Vec::new())
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let fit = self.fit(rate_hz, signal)?;
        for (i, out) in out.iter_mut().enumerate().take(signal.len()) {
            [*out, ..] = fit.at(i);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{differentiated, normal};
    use core::f64::consts::TAU;

    #[test]
    fn a_series_with_a_line_is_differentiated_exactly() {
        let (rate, base) = (200.0, 0.13);
        // Not a whole number of periods, and not at rest at the ends.
        let motion = |t: f64| {
            let mut x = [4.0 - 0.2 * t, -0.2, 0.0];
            for (k, (a, b)) in [(0.7, -0.2), (0.1, 0.3), (-0.05, 0.02)].into_iter().enumerate() {
                let w = TAU * base * (k + 1) as f64;
                let (sin, cos) = (w * t).sin_cos();
                x[0] += a * sin + b * cos;
                x[1] += w * (a * cos - b * sin);
                x[2] -= w * w * (a * sin + b * cos);
            }
            x
        };
        let q: Vec<f64> = (0..3000).map(|i| motion(f64::from(i) / rate)[0]).collect();
        let out = differentiated(&FourierFit::new(base, 3, true).unwrap(), rate, &q);
        for i in 0..3000 {
            let exact = motion(f64::from(i as u32) / rate);
            for order in 0..3 {
                // Rounding of 1e-16 times the condition of the basis (about 10) and a few sums.
                assert!((out[order][i] - exact[order]).abs() < 1e-12, "{order} {i}");
            }
        }
    }

    #[test]
    fn noise_gain_follows_the_closed_form() {
        // Ten whole periods: the columns are orthogonal, and the variance is that of 2K + 1 coefficients.
        let (rate, base, harmonics, n) = (100.0, 0.5, 3_usize, 2000_usize);
        let fit = FourierFit::new(base, harmonics, false).unwrap();
        let (mut sums, runs) = ([0.0; 3], 40_u64);
        for run in 0..runs {
            let out = differentiated(&fit, rate, &normal(run, n));
            for (sum, out) in sums.iter_mut().zip(&out) {
                *sum += out.iter().map(|x| x * x).sum::<f64>() / n as f64;
            }
        }
        let power = |order: i32| (1..=harmonics).map(|k| (TAU * base * k as f64).powi(2 * order)).sum::<f64>();
        let expected = [(2.0 * power(0) + 1.0) / n as f64, 2.0 * power(1) / n as f64, 2.0 * power(2) / n as f64];
        for (sum, expected) in sums.iter().zip(expected) {
            // 40 runs of 7 (6, 6, unequally weighted) chi-square values: relative deviation √(2/240) = 0.09, up to 0.13
            // if one harmonic dominates; four deviations are allowed.
            assert!((sum / runs as f64 / expected - 1.0).abs() < 0.5, "{sums:?} {expected:?}");
        }
    }

    #[test]
    fn indistinguishable_harmonics_are_rejected() {
        assert!(FourierFit::new(0.0, 3, true).is_err());
        assert!(FourierFit::new(f64::NAN, 3, true).is_err());
        assert!(FourierFit::new(1.0, 0, true).is_err());
        assert!(FourierFit::new(1.0, 201, true).is_err());
        let n = 40;
        let mut out = vec![0.0; n];
        // A thousandth of a period, and harmonics above half the rate.
        let short = FourierFit::new(1e-4, 5, true).unwrap().smooth(10.0, &vec![1.0; n], &mut out);
        assert!(matches!(short, Err(FilterError::Undetermined { .. })), "{short:?}");
        let high = FourierFit::new(1.0, 5, true).unwrap().smooth(10.0, &vec![1.0; n], &mut out);
        assert!(matches!(high, Err(FilterError::AboveNyquist { .. })), "{high:?}");
        let few = FourierFit::new(1.0, 30, true).unwrap().smooth(1000.0, &vec![1.0; n], &mut out);
        assert!(matches!(few, Err(FilterError::TooShort { .. })), "{few:?}");
    }
}
