//! Zero-phase Butterworth filter and its exact central differences.

use crate::differentiator::{Derivatives, Differentiator};
use crate::error::FilterError;
use crate::sections::{Section, Triple, butterworth_low_pass, pole_radius, run};

/// Transients at the end of a window fall below this part of the signal inside [`Differentiator::context_samples`].
const TRANSIENT: f64 = 1e-15;

/// A Butterworth low-pass run forwards and backwards, then differentiated.
///
/// Filtered position: `scipy.signal.sosfiltfilt(butter(order, cutoff_hz, fs=rate_hz, output="sos"), q)`, with its odd
/// extension by the default length at both ends. The amplitude is `1 / (1 + (tan(πf/rate)/tan(πf_c/rate))^(2 order))`, so one half at
/// the cut-off.
///
/// Derivatives: central differences of sixth order of the filtered signal y (its extension included, so that there is no
/// one-sided formula at the ends), with δ²y = y₊ - 2y + y₋ and μδy = (y₊ - y₋)/2:
///
/// `dq = rate · (μδ - μδ³/6 + μδ⁵/30) y`,  `ddq = rate² · (δ² - δ⁴/12 + δ⁶/90) y`
///
/// The differences are not taken from y itself: first and second differences of q go through the same recursion beside q.
/// That is the same by linearity, but rounding is then relative to the acceleration and not to the position,
/// which is what a 5 kHz log needs (two differences of y would cost eight digits there).
/// Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 25.3; Gustafsson, IEEE Trans. Signal Process. 44 (1996) 988.
#[derive(Clone, Debug, PartialEq)]
pub struct ButterworthZeroPhase {
    order: usize,
    cutoff_hz: f64,
}

impl ButterworthZeroPhase {
    /// A filter of one-way order `order` and cut-off `cutoff_hz`.
    ///
    /// # Errors
    /// If `order` is not 1 to 12 or the cut-off is not positive.
    pub fn new(order: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        // Any rate above twice the cut-off does for checking the two.
        butterworth_low_pass(order, cutoff_hz, 4.0 * cutoff_hz)?;
        Ok(Self { order, cutoff_hz })
    }

    /// The cut-off, where the two-way gain is one half.
    pub fn cutoff_hz(&self) -> f64 {
        self.cutoff_hz
    }

    /// Length of the odd extension: three times the filter's length, as `sosfiltfilt` has it.
    fn padding(&self) -> usize {
        3 * (self.order + 1)
    }

    fn sections(&self, rate_hz: f64, found: usize) -> Result<Vec<Section>, FilterError> {
        if found < self.minimum_samples() {
            return Err(FilterError::TooShort { method: self.name(), found, needed: self.minimum_samples() });
        }
        butterworth_low_pass(self.order, self.cutoff_hz, rate_hz)
    }
}

impl Differentiator for ButterworthZeroPhase {
    fn name(&self) -> &'static str {
        "butterworth"
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        let Ok(sections) = butterworth_low_pass(self.order, self.cutoff_hz, rate_hz) else { return Some(0) };
        // The factor covers the amplification of transients by the cascade.
        let decay = (TRANSIENT.ln() / pole_radius(&sections).ln()).abs();
        Some((1.3 * decay).ceil() as usize + self.padding())
    }

    fn minimum_samples(&self) -> usize {
        self.padding() + 1
    }

    fn differentiate(&self, rate_hz: f64, q: &[f64], out: Derivatives<'_>) -> Result<(), FilterError> {
        let sections = self.sections(rate_hz, q.len())?;
        let pad = self.padding();
        let mut signal = extended(q, pad);
        let last = signal.len() - 1;
        // Differences in place, backwards: d1[n] = x[n] - x[n-1], d2[n] = d1[n+1] - d1[n], constant before the start. The
        // steady state in which the forward run starts is that of a constant, whose differences are zero.
        for n in (1..=last).rev() {
            signal[n][1] = signal[n][0] - signal[n - 1][0];
        }
        for n in 0..last {
            signal[n][2] = signal[n + 1][1] - signal[n][1];
        }
        let start = signal[0][0];
        // The run of d2 is one sample ahead of d1: its own history begins with d2[-1] = d1[0] - d1[-1] = 0.
        run(&sections, &mut signal, [start, 0.0, 0.0], false);
        // The backward run starts in the steady state of the last value: beyond the end the first difference is zero, so
        // the second difference at the end is minus the first difference there.
        signal[last][2] = -signal[last][1];
        let end = signal[last][0];
        run(&sections, &mut signal, [end, 0.0, 0.0], true);
        for i in 0..q.len() {
            [out.q[i], out.dq[i], out.ddq[i]] = sixth_order(&signal, pad + i, rate_hz);
        }
        Ok(())
    }

    fn smooth(&self, rate_hz: f64, input: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let sections = self.sections(rate_hz, input.len())?;
        let pad = self.padding();
        let mut signal = extended(input, pad);
        let start = signal[0][0];
        run(&sections, &mut signal, [start, 0.0, 0.0], false);
        let end = signal[signal.len() - 1][0];
        run(&sections, &mut signal, [end, 0.0, 0.0], true);
        for (out, value) in out.iter_mut().zip(&signal[pad..pad + input.len()]) {
            *out = value[0];
        }
        Ok(())
    }
}

/// Samples on either side that [`sixth_order`] needs.
pub(crate) const DIFFERENCE_REACH: usize = 3;

/// Value, first and second derivative at sample `n` from the signal with its backward first and central second differences: central differences of sixth order.
pub(crate) fn sixth_order(signal: &[Triple], n: usize, rate_hz: f64) -> [f64; 3] {
    let d2 = |k: isize| signal[n.wrapping_add_signed(k)][2];
    let first = 0.5 * (signal[n][1] + signal[n + 1][1]);
    // mu delta^3 and mu delta^5, delta^4 and delta^6 from second differences.
    let third = 0.5 * (d2(1) - d2(-1));
    let fifth = 0.5 * (d2(2) - 2.0 * d2(1) + 2.0 * d2(-1) - d2(-2));
    let fourth = d2(1) - 2.0 * d2(0) + d2(-1);
    let sixth = d2(2) - 4.0 * d2(1) + 6.0 * d2(0) - 4.0 * d2(-1) + d2(-2);
    [
        signal[n][0],
        rate_hz * (first - third / 6.0 + fifth / 30.0),
        rate_hz * rate_hz * (d2(0) - fourth / 12.0 + sixth / 90.0),
    ]
}

/// The signal with `pad` more on either side, point-mirrored at its end values: `2 x₀ - x_k`.
pub(crate) fn extended(signal: &[f64], pad: usize) -> Vec<Triple> {
    let (first, last) = (signal[0], signal[signal.len() - 1]);
    let before = signal[1..=pad].iter().rev().map(|x| 2.0 * first - x);
    let after = signal[signal.len() - 1 - pad..signal.len() - 1].iter().rev().map(|x| 2.0 * last - x);
    before.chain(signal.iter().copied()).chain(after).map(|x| [x, 0.0, 0.0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    #[test]
    fn gain_is_one_half_at_the_cutoff_and_the_phase_is_zero() {
        let (rate, cutoff, n) = (500.0, 10.0, 2000_usize);
        let filter = ButterworthZeroPhase::new(4, cutoff).unwrap();
        let time = |i: usize| i as f64 / rate;
        let q: Vec<f64> = (0..n).map(|i| (TAU * cutoff * time(i)).sin()).collect();
        let (mut y, mut dy, mut ddy) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        filter.differentiate(rate, &q, Derivatives { q: &mut y, dq: &mut dy, ddq: &mut ddy }).unwrap();
        let omega = TAU * cutoff;
        // Truncation of the sixth-order formulas: (omega h)^6 / 140 = 3e-8 and / 560 = 7e-9 of the derivative.
        for i in 800..1200 {
            let (sin, cos) = (omega * time(i)).sin_cos();
            assert!((y[i] - 0.5 * sin).abs() < 1e-10, "{i}: {}", y[i]);
            assert!((dy[i] - 0.5 * omega * cos).abs() < 1e-7 * omega, "{i}");
            assert!((ddy[i] + 0.5 * omega * omega * sin).abs() < 1e-7 * omega * omega, "{i}");
        }
    }

    #[test]
    fn too_short_signals_and_bad_cutoffs_are_refused() {
        let filter = ButterworthZeroPhase::new(4, 10.0).unwrap();
        let mut out = [0.0; 15];
        assert!(filter.smooth(500.0, &[0.0; 15], &mut out).is_err());
        assert!(filter.smooth(20.0, &[0.0; 100], &mut [0.0; 100]).is_err());
        assert!(ButterworthZeroPhase::new(4, f64::NAN).is_err());
        assert!(ButterworthZeroPhase::new(0, 1.0).is_err());
        // A cut-off with which no digit would be left.
        let slow = ButterworthZeroPhase::new(4, 1e-9).unwrap();
        assert!(slow.smooth(1000.0, &[0.0; 100], &mut [0.0; 100]).is_err());
        assert_eq!(slow.context_samples(1000.0), Some(0));
        assert!(ButterworthZeroPhase::new(4, -3.0).is_err());
    }
}
