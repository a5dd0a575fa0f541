//! Differentiator that works in the frequency domain.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::{FilterError, require};
use crate::filter::bridge::{MIN_END_SAMPLES, bridge};
use core::f64::consts::{PI, TAU};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use serde::{Deserialize, Serialize};

/// Length of the transition from the end of a piece to its start, in periods of the cut-off frequency.
const BRIDGE_PERIODS: f64 = 8.0;

/// Frequency at which the gain reaches zero with tapered ends, as a ratio to the cut-off.
const TAPER_END_RATIO: f64 = 2.0;

/// Extension of a piece beyond its ends, because the Fourier transform assumes a periodic signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Ends {
    /// A smooth transition (bridge) from the end to the start over eight periods of the cut-off, with continuous value,
    /// velocity and acceleration for any motion. From the cut-off to twice the cut-off, the gain falls as half a
    /// cosine, so that ringing is limited to the ends. One period of the cut-off at either end is not used.
    #[default]
    Tapered,
    /// The piece, followed by the reversed piece. Value and acceleration are continuous; the velocity is continuous if
    /// the motion is at rest at both ends.
    Mirrored,
    /// The piece, repeated. Use it for whole periods of a steady periodic motion; any other motion causes errors at all
    /// frequencies.
    Periodic,
}

/// Differentiates the discrete Fourier transform X of the whole piece, truncated at the cut-off f_c:
///
/// `q = F⁻¹{X}`, `dq = F⁻¹{jω X}`, `ddq = F⁻¹{-ω² X}`, |ω| <= 2π f_c.
///
/// Exact for a periodic motion below the cut-off over whole periods ([`Ends::Periodic`]). White noise of standard
/// deviation σ causes a standard deviation of `σ √(2 f_c/rate)` in q, `2π f_c σ √(2 f_c/(3 rate))` in dq and
/// `(2π f_c)² σ √(2 f_c/(5 rate))` in ddq; with tapered ends 1.17, 1.65 and 2.41 times these values. If a motion is
/// mirrored while it moves, ringing extends far into the piece; use tapered ends. Source: Swevers, Ganseman, Tükel, de
/// Schutter, van Brussel, IEEE Trans. Robot. Autom. 13 (1997) 730; the tapered ends were developed for Dynident.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyDomain {
    cutoff_hz: f64,
    ends: Ends,
}

impl FrequencyDomain {
    /// Creates a differentiator that keeps frequencies up to `cutoff_hz`.
    ///
    /// # Errors
    /// If the cut-off is not positive.
    pub fn new(cutoff_hz: f64, ends: Ends) -> Result<Self, FilterError> {
        require(cutoff_hz.is_finite() && cutoff_hz > 0.0, "cutoff_hz", cutoff_hz, "give a positive frequency")?;
        Ok(Self { cutoff_hz, ends })
    }

    /// Number of samples in one period of the cut-off: the length of the polynomial fit at tapered ends, and of the
    /// ends that are not used.
    fn edge(&self, rate_hz: f64) -> usize {
        ((rate_hz / self.cutoff_hz).ceil() as usize).max(MIN_END_SAMPLES)
    }

    fn gain(&self, hz: f64) -> f64 {
        let beyond = (hz / self.cutoff_hz - 1.0) / (TAPER_END_RATIO - 1.0);
        match self.ends {
            _ if beyond <= 0.0 => 1.0,
            Ends::Tapered if beyond < 1.0 => 0.5 * (1.0 + (PI * beyond).cos()),
            _ => 0.0,
        }
    }

    /// Multiplies the transform by (jω)^order below the cut-off, for the orders from 0 to `out.len() - 1`, and
    /// transforms back.
    fn transformed(&self, rate_hz: f64, signal: &[f64], out: &mut [&mut [f64]]) -> Result<(), FilterError> {
        let n = signal.len();
        self.check_length(n)?;
        if self.cutoff_hz.partial_cmp(&(0.5 * rate_hz)) != Some(core::cmp::Ordering::Less) {
            return Err(FilterError::AboveNyquist { cutoff_hz: self.cutoff_hz, rate_hz });
        }
        // Values are relative to the first sample, so that rounding errors scale with the motion.
        let origin = signal[0];
        let mut input: Vec<f64> = signal.iter().map(|x| x - origin).collect();
        match self.ends {
            Ends::Tapered => {
                let window = self.edge(rate_hz);
                if n < window {
                    return Err(FilterError::TooShort { method: self.name(), found: n, needed: window });
                }
                let rest = bridge(&input, window, (BRIDGE_PERIODS * rate_hz / self.cutoff_hz).ceil() as usize);
                input.extend(rest);
            }
            Ends::Mirrored => input.extend((1..n - 1).rev().map(|i| signal[i] - origin)),
            Ends::Periodic => {}
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
                let gain = scale * self.gain(hz);
                let factor = match order {
                    0 => Complex::new(gain, 0.0),
                    1 => Complex::new(0.0, gain * TAU * hz),
                    _ => Complex::new(-gain * (TAU * hz).powi(2), 0.0),
                };
                *bin *= factor;
            }
            // The first and last bin of a real signal are real.
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

    fn minimum_samples(&self) -> usize {
        4
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        self.transformed(place.rate_hz, q, &mut [out.q, out.dq, out.ddq])?;
        if self.ends != Ends::Tapered {
            return Ok(Vec::new());
        }
        let edge = self.edge(place.rate_hz);
        let whole = 2 * edge >= q.len();
        Ok(if whole { core::iter::once(0..q.len()).collect() } else { vec![0..edge, q.len() - edge..q.len()] })
    }

    fn smooth(&self, rate_hz: f64, signal: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        self.transformed(rate_hz, signal, &mut [out])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::{differentiated, normal, rms};

    #[test]
    fn whole_periods_are_differentiated_exactly() {
        // Even and odd numbers of samples; the second harmonic lies at the cut-off.
        for n in [400_usize, 401] {
            let (rate, base) = (100.0, 100.0 / n as f64);
            let differentiator = FrequencyDomain::new(2.0 * base * (1.0 + 1e-12), Ends::Periodic).unwrap();
            let w = TAU * base;
            let at = |i: usize| (w * i as f64 / rate, 0.5 * w * 4.0);
            let q: Vec<f64> = (0..n).map(|i| 7.0 + at(i).0.sin() + 0.5 * (2.0 * at(i).0).cos()).collect();
            let out = differentiated(&differentiator, rate, &q);
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
        // A half cosine mirrored is a full cosine, so the result is exact.
        let (rate, n) = (200.0, 501_usize);
        let w = core::f64::consts::PI * rate / (n as f64 - 1.0);
        let q: Vec<f64> = (0..n).map(|i| 1.0 - (w * i as f64 / rate).cos()).collect();
        let out = differentiated(&FrequencyDomain::new(2.0, Ends::Mirrored).unwrap(), rate, &q);
        for i in 0..n {
            let (sin, cos) = (w * i as f64 / rate).sin_cos();
            assert!((out[1][i] - w * sin).abs() < 1e-12 && (out[2][i] - w * w * cos).abs() < 1e-11, "{i}");
        }
    }

    /// A sum of sines cut at arbitrary ends: mirrored, it rings far into the piece.
    #[test]
    fn a_motion_that_moves_at_its_ends_rings_only_near_them() {
        let (rate, n, cutoff) = (500.0, 10_000_usize, 1.0);
        let at = |i: usize| {
            let mut sum = [0.0; 3];
            for k in 1..=5 {
                let w = TAU * 0.1 * f64::from(k);
                let (sin, cos) = (w * i as f64 / rate + f64::from(k * k)).sin_cos();
                let size = 0.6 / f64::from(k);
                (sum[0], sum[1], sum[2]) = (sum[0] + size * sin, sum[1] + size * w * cos, sum[2] - size * w * w * sin);
            }
            sum
        };
        let q: Vec<f64> = (0..n).map(|i| at(i)[0]).collect();
        let worst = |ends: Ends| {
            let differentiator = FrequencyDomain::new(cutoff, ends).unwrap();
            let mut out = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
            let [own_q, dq, ddq] = &mut out;
            let place = Place { rate_hz: rate, joint: 0, first_time_s: 0.0 };
            let marked = differentiator.differentiate_at(place, &q, Derivatives { q: own_q, dq, ddq }).unwrap();
            let is_compared = |i: &usize| (500..n - 500).contains(i);
            let error = |k: usize| (0..n).filter(is_compared).map(|i| (out[k][i] - at(i)[k]).abs()).fold(0.0, f64::max);
            (marked, [error(0), error(1), error(2)])
        };
        let (marked, tapered) = worst(Ends::Tapered);
        assert_eq!(marked, [0..500, n - 500..n]);
        // Effect of a jump in the third derivative (10 rad/s³) through a tapered band edge, one period of the cut-off
        // away: below a thousandth of the velocity (1.9 rad/s) and the acceleration (3 rad/s²).
        assert!(tapered[0] < 1e-3 && tapered[1] < 2e-3 && tapered[2] < 3e-3, "{tapered:?}");
        let (marked, mirrored) = worst(Ends::Mirrored);
        assert!(marked.is_empty() && mirrored[2] > 20.0 * tapered[2], "{mirrored:?} {tapered:?}");
    }

    #[test]
    fn a_tapered_band_edge_has_the_documented_noise_gain() {
        let (rate, cutoff, n) = (1000.0, 40.0, 1 << 15);
        let out = differentiated(&FrequencyDomain::new(cutoff, Ends::Tapered).unwrap(), rate, &normal(3, n));
        let (top, band) = (TAU * cutoff, 2.0 * cutoff / rate);
        let expected = [1.17 * band.sqrt(), 1.65 * top * (band / 3.0).sqrt(), 2.41 * top * top * (band / 5.0).sqrt()];
        for (out, expected) in out.iter().zip(expected) {
            // As below; in addition, the bridge (10 of 1311 periods of the cut-off) has other noise.
            assert!((rms(out) / expected - 1.0).abs() < 0.13, "{} {expected}", rms(out));
        }
    }

    #[test]
    fn noise_gain_follows_the_bandwidth() {
        let (rate, cutoff, n) = (1000.0, 40.0, 1 << 15);
        let out = differentiated(&FrequencyDomain::new(cutoff, Ends::Periodic).unwrap(), rate, &normal(3, n));
        let (top, band) = (TAU * cutoff, 2.0 * cutoff / rate);
        let expected = [band.sqrt(), top * (band / 3.0).sqrt(), top * top * (band / 5.0).sqrt()];
        for (out, expected) in out.iter().zip(expected) {
            // 2620 real coefficients, mainly those near the cut-off: relative deviation below √(5/(2·2620)) = 3 %; four
            // deviations are allowed.
            assert!((rms(out) / expected - 1.0).abs() < 0.12, "{} {expected}", rms(out));
        }
    }

    #[test]
    fn bad_cutoffs_and_short_signals_are_refused() {
        assert!(FrequencyDomain::new(0.0, Ends::Periodic).is_err());
        assert!(FrequencyDomain::new(f64::INFINITY, Ends::Periodic).is_err());
        // The polynomial fit needs ten samples.
        assert!(FrequencyDomain::new(3.0, Ends::Tapered).unwrap().smooth(10.0, &[0.0; 9], &mut [0.0; 9]).is_err());
        let differentiator = FrequencyDomain::new(3.0, Ends::Mirrored).unwrap();
        assert!(differentiator.smooth(10.0, &[0.0; 3], &mut [0.0; 3]).is_err());
        assert!(differentiator.smooth(6.0, &[0.0; 30], &mut [0.0; 30]).is_err());
        let mut out = [1.0; 4];
        differentiator.smooth(10.0, &[2.0; 4], &mut out).unwrap();
        assert_eq!(out, [2.0; 4]);
    }
}
