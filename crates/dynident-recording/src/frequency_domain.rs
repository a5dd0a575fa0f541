//! Differentiation in the frequency domain.

use crate::differentiator::{Derivatives, Differentiator};
use crate::error::FilterError;
use core::f64::consts::TAU;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use serde::{Deserialize, Serialize};

/// What stands beyond the ends of a piece: the transform takes it to repeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ends {
    /// The piece, then the piece backwards: value and acceleration go on without a jump, and so does the speed of a motion that is at rest at both ends.
    #[default]
    Mirrored,
    /// The piece again: for whole periods of a settled periodic motion. Anything else leaks into all frequencies.
    Periodic,
}

/// The discrete Fourier transform X of the whole piece, kept from zero to the cut-off and zero elsewhere:
///
/// `q = F⁻¹{X}`, `dq = F⁻¹{jω X}`, `ddq = F⁻¹{-ω² X}`, |ω| <= 2π f_c.
///
/// Exact for a periodic motion below the cut-off over whole periods. White noise of standard deviation σ leaves `σ √(2 f_c/rate)` in q, `2π f_c σ √(2 f_c/(3 rate))` in dq and
/// `(2π f_c)² σ √(2 f_c/(5 rate))` in ddq. A motion that does not repeat, or is mirrored while it moves, rings near the ends: leave them out with `trim_s`.
/// Source: Swevers, Ganseman, Tükel, de Schutter, van Brussel, IEEE Trans. Robot. Autom. 13 (1997) 730.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyDomain {
    cutoff_hz: f64,
    ends: Ends,
}

impl FrequencyDomain {
    /// Keeps what lies at or below `cutoff_hz`.
    ///
    /// # Errors
    /// If the cut-off is not positive.
    pub fn new(cutoff_hz: f64, ends: Ends) -> Result<Self, FilterError> {
        if cutoff_hz.is_finite() && cutoff_hz > 0.0 {
            Ok(Self { cutoff_hz, ends })
        } else {
            Err(FilterError::Setting { name: "cutoff_hz", value: cutoff_hz, mend: "give a positive frequency" })
        }
    }

    /// Applies (jω)^order in the band, for each of `orders`.
    fn transformed(&self, rate_hz: f64, signal: &[f64], out: &mut [&mut [f64]]) -> Result<(), FilterError> {
        let n = signal.len();
        if n < self.minimum_samples() {
            return Err(FilterError::TooShort { method: self.name(), found: n, needed: self.minimum_samples() });
        }
        if self.cutoff_hz.partial_cmp(&(0.5 * rate_hz)) != Some(core::cmp::Ordering::Less) {
            return Err(FilterError::AboveNyquist { cutoff_hz: self.cutoff_hz, rate_hz });
        }
        // Relative to the first sample: rounding then scales with the motion.
        let origin = signal[0];
        let mut input: Vec<f64> = signal.iter().map(|x| x - origin).collect();
        if self.ends == Ends::Mirrored {
            input.extend((1..n - 1).rev().map(|i| signal[i] - origin));
        }
        let length = input.len();
        let mut planner = RealFftPlanner::<f64>::new();
        let (forward, backward) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
        let mut spectrum = forward.make_output_vec();
        let wrong = |_| FilterError::TooShort { method: "frequency-domain", found: n, needed: 4 };
        forward.process(&mut input, &mut spectrum).map_err(wrong)?;
        let scale = 1.0 / length as f64;
        for (order, out) in out.iter_mut().enumerate() {
            let mut bins: Vec<Complex<f64>> = spectrum.clone();
            for (k, bin) in bins.iter_mut().enumerate() {
                let hz = k as f64 * rate_hz / length as f64;
                let factor = match order {
                    _ if hz > self.cutoff_hz => Complex::new(0.0, 0.0),
                    0 => Complex::new(scale, 0.0),
                    1 => Complex::new(0.0, scale * TAU * hz),
                    _ => Complex::new(-scale * (TAU * hz).powi(2), 0.0),
                };
                *bin *= factor;
            }
            // What a real signal's first and last bin must be, to the last bit.
            bins[0].im = 0.0;
            if length.is_multiple_of(2)
                && let Some(last) = bins.last_mut()
            {
                last.im = 0.0;
            }
            backward.process(&mut bins, &mut input).map_err(wrong)?;
            let offset = if order == 0 { origin } else { 0.0 };
            for (out, x) in out.iter_mut().zip(&input[..n]) {
                *out = x + offset;
            }
        }
        Ok(())
    }
}

impl Differentiator for FrequencyDomain {
    fn name(&self) -> &'static str {
        "frequency-domain"
    }

    fn context_samples(&self, _rate_hz: f64) -> Option<usize> {
        None
    }

    fn minimum_samples(&self) -> usize {
        4
    }

    fn differentiate(&self, rate_hz: f64, q: &[f64], out: Derivatives<'_>) -> Result<(), FilterError> {
        self.transformed(rate_hz, q, &mut [out.q, out.dq, out.ddq])
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.transformed(rate_hz, signal, &mut [out])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_signals::{differentiated, normal, rms};

    #[test]
    fn whole_periods_are_differentiated_exactly() {
        // Even and odd numbers of samples; the second harmonic stands at the cut-off itself.
        for n in [400_usize, 401] {
            let (rate, base) = (100.0, 100.0 / n as f64);
            let way = FrequencyDomain::new(2.0 * base * (1.0 + 1e-12), Ends::Periodic).unwrap();
            let w = TAU * base;
            let at = |i: usize| (w * i as f64 / rate, 0.5 * w * 4.0);
            let q: Vec<f64> = (0..n).map(|i| 7.0 + at(i).0.sin() + 0.5 * (2.0 * at(i).0).cos()).collect();
            let out = differentiated(&way, rate, &q);
            for i in 0..n {
                let x = at(i).0;
                // Rounding of the transform: a few 1e-16 of the signal, times the frequency.
                assert!((out[0][i] - q[i]).abs() < 1e-13);
                assert!((out[1][i] - w * (x.cos() - (2.0 * x).sin())).abs() < 1e-12 * w);
                assert!((out[2][i] + w * w * (x.sin() + 2.0 * (2.0 * x).cos())).abs() < 1e-12 * w * w);
            }
        }
    }

    #[test]
    fn a_mirrored_motion_from_rest_to_rest_has_no_jump_at_its_ends() {
        // A half cosine mirrored is a whole one: exact although the piece ends elsewhere than it began.
        let (rate, n) = (200.0, 501_usize);
        let w = core::f64::consts::PI * rate / (n as f64 - 1.0);
        let q: Vec<f64> = (0..n).map(|i| 1.0 - (w * i as f64 / rate).cos()).collect();
        let out = differentiated(&FrequencyDomain::new(2.0, Ends::Mirrored).unwrap(), rate, &q);
        for i in 0..n {
            let (sin, cos) = (w * i as f64 / rate).sin_cos();
            assert!((out[1][i] - w * sin).abs() < 1e-12 && (out[2][i] - w * w * cos).abs() < 1e-11, "{i}");
        }
    }

    #[test]
    fn noise_comes_out_as_the_band_says() {
        let (rate, cutoff, n) = (1000.0, 40.0, 1 << 15);
        let out = differentiated(&FrequencyDomain::new(cutoff, Ends::Periodic).unwrap(), rate, &normal(3, n));
        let (top, band) = (TAU * cutoff, 2.0 * cutoff / rate);
        let expected = [band.sqrt(), top * (band / 3.0).sqrt(), top * top * (band / 5.0).sqrt()];
        for (out, expected) in out.iter().zip(expected) {
            // 2620 real coefficients, those near the top counting most: relative deviation below √(5/(2·2620)) = 3 %; 4 of them.
            assert!((rms(out) / expected - 1.0).abs() < 0.12, "{} {expected}", rms(out));
        }
    }

    #[test]
    fn bad_cutoffs_and_short_signals_are_refused() {
        assert!(FrequencyDomain::new(0.0, Ends::Periodic).is_err());
        assert!(FrequencyDomain::new(f64::INFINITY, Ends::Periodic).is_err());
        let way = FrequencyDomain::new(3.0, Ends::Mirrored).unwrap();
        assert!(way.smooth(10.0, &[0.0; 3], &mut [0.0; 3]).is_err());
        assert!(way.smooth(6.0, &[0.0; 30], &mut [0.0; 30]).is_err());
        let mut out = [1.0; 4];
        way.smooth(10.0, &[2.0; 4], &mut out).unwrap();
        assert_eq!(out, [2.0; 4]);
    }
}
