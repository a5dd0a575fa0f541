//! A causal Butterworth low-pass: what a drive's firmware does, with the lag that it costs.

use crate::butterworth::{DIFFERENCE_REACH, extended, sixth_order};
use crate::differentiator::{Derivatives, Differentiator};
use crate::error::FilterError;
use crate::sections::{Section, butterworth_low_pass, pole_radius, run};

/// Transients fall below this part of the signal inside [`Differentiator::context_samples`].
const TRANSIENT: f64 = 1e-15;

/// A Butterworth low-pass run forwards only, then differentiated by central differences of sixth order.
///
/// Amplitude `1 / √(1 + (tan(πf/rate)/tan(πf_c/rate))^(2 order))`, so 0.707 at the cut-off. q, dq and ddq all come late by the filter's
/// [delay](Self::delay_s); the torque does not, unless it passes [`smooth`](Differentiator::smooth) as well. A regressor that lags the torque by δ
/// biases the fit by about ωδ at each frequency ω of the motion: this way stands here for comparison, and for logs whose torque was filtered the same way.
///
/// The run starts in the steady state of a point-mirrored extension of three filter lengths, as in [`ButterworthZeroPhase`](crate::ButterworthZeroPhase).
/// Source: Atkeson, An, Hollerbach, Int. J. Robotics Res. 5 (1986) 101 (filtered by a low-pass before differentiation); Oppenheim and Schafer, Discrete-Time Signal Processing, 7.1.2.
#[derive(Clone, Debug, PartialEq)]
pub struct LowPass {
    order: usize,
    cutoff_hz: f64,
}

impl LowPass {
    /// A filter of order `order` and cut-off `cutoff_hz`.
    ///
    /// # Errors
    /// If `order` is not 1 to 12 or the cut-off is not positive.
    pub fn new(order: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        // Any rate above twice the cut-off does for checking the two.
        butterworth_low_pass(order, cutoff_hz, 4.0 * cutoff_hz)?;
        Ok(Self { order, cutoff_hz })
    }

    /// Seconds by which a slow signal comes out late: the group delay at zero frequency. For an analogue Butterworth filter of order n that is
    /// `Σ_k sin(π(2k+1)/2n) / (2π f_c)`, so 2.61/(2π f_c) for order 4.
    ///
    /// # Errors
    /// If the cut-off is not below half of `rate_hz`.
    pub fn delay_s(&self, rate_hz: f64) -> Result<f64, FilterError> {
        let sections = butterworth_low_pass(self.order, self.cutoff_hz, rate_hz)?;
        // For H = B/A of unit gain: Σ k b_k / Σ b_k - Σ k a_k / Σ a_k.
        let delay = |section: &Section| {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            (b1 + 2.0 * b2) / (b0 + b1 + b2) - (a1 + 2.0 * a2) / (1.0 + a1 + a2)
        };
        Ok(sections.iter().map(delay).sum::<f64>() / rate_hz)
    }

    fn padding(&self) -> usize {
        (3 * (self.order + 1)).max(DIFFERENCE_REACH)
    }

    fn sections(&self, rate_hz: f64, found: usize) -> Result<Vec<Section>, FilterError> {
        if found < self.minimum_samples() {
            return Err(FilterError::TooShort { method: self.name(), found, needed: self.minimum_samples() });
        }
        butterworth_low_pass(self.order, self.cutoff_hz, rate_hz)
    }
}

impl Differentiator for LowPass {
    fn name(&self) -> &'static str {
        "low-pass"
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        let Ok(sections) = butterworth_low_pass(self.order, self.cutoff_hz, rate_hz) else { return Some(0) };
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
        // First and second differences beside the signal, as in the zero-phase filter: rounding is then relative to the motion.
        for n in (1..=last).rev() {
            signal[n][1] = signal[n][0] - signal[n - 1][0];
        }
        for n in 0..last {
            signal[n][2] = signal[n + 1][1] - signal[n][1];
        }
        let start = signal[0][0];
        run(&sections, &mut signal, [start, 0.0, 0.0], false);
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
        for (out, value) in out.iter_mut().zip(&signal[pad..pad + input.len()]) {
            *out = value[0];
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    #[test]
    fn a_sine_comes_out_with_the_filters_gain_and_phase() {
        // An independent route: the transfer function as a product of analogue poles at the warped frequency.
        let (rate, cutoff, frequency, n) = (500.0, 10.0, 6.0, 2000_usize);
        let x = (core::f64::consts::PI * frequency / rate).tan() / (core::f64::consts::PI * cutoff / rate).tan();
        let (mut gain, mut phase) = (1.0, 0.0);
        for k in 0..4 {
            let angle = TAU / 4.0 + TAU / 16.0 * f64::from(2 * k + 1);
            let (re, im) = (-angle.cos(), x - angle.sin());
            gain /= re.hypot(im);
            phase -= im.atan2(re);
        }
        let filter = LowPass::new(4, cutoff).unwrap();
        let omega = TAU * frequency;
        let q: Vec<f64> = (0..n).map(|i| (omega * i as f64 / rate).sin()).collect();
        let mut out = [vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        let [y, dy, ddy] = &mut out;
        filter.differentiate(rate, &q, Derivatives { q: y, dq: dy, ddq: ddy }).unwrap();
        // Truncation of the sixth-order formulas: (omega h)^6 / 140 = 1.3e-9 of the derivative; transients have died by half-way.
        for i in 1000..1990 {
            let (sin, cos) = (omega * i as f64 / rate + phase).sin_cos();
            assert!((out[0][i] - gain * sin).abs() < 1e-10, "{i}");
            assert!((out[1][i] - gain * omega * cos).abs() < 1e-8 * omega, "{i}");
            assert!((out[2][i] + gain * omega * omega * sin).abs() < 1e-8 * omega * omega, "{i}");
        }
        let mut smooth = vec![0.0; n];
        filter.smooth(rate, &q, &mut smooth).unwrap();
        assert!(smooth.iter().zip(&out[0]).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn a_ramp_comes_late_by_the_delay() {
        let (rate, n) = (1000.0, 3000_usize);
        for order in 1..=8 {
            let filter = LowPass::new(order, 5.0).unwrap();
            let delay = filter.delay_s(rate).unwrap();
            let analogue: f64 =
                (0..order).map(|k| (TAU / 4.0 * (2 * k + 1) as f64 / order as f64).sin()).sum::<f64>() / (TAU * 5.0);
            // The bilinear transform's pre-warping changes the delay by (π f_c/rate)²/3 = 8e-5 of it.
            assert!((delay / analogue - 1.0).abs() < 2e-4, "order {order}: {delay} and {analogue}");
            let q: Vec<f64> = (0..n).map(|i| i as f64 / rate).collect();
            let mut y = vec![0.0; n];
            filter.smooth(rate, &q, &mut y).unwrap();
            assert!((y[2900] - (2.9 - delay)).abs() < 1e-9, "order {order}");
        }
    }

    #[test]
    fn bad_settings_and_short_signals_are_refused() {
        assert!(LowPass::new(0, 1.0).is_err());
        assert!(LowPass::new(4, f64::NAN).is_err());
        let filter = LowPass::new(4, 10.0).unwrap();
        assert!(filter.smooth(500.0, &[0.0; 10], &mut [0.0; 10]).is_err());
        assert!(filter.smooth(15.0, &[0.0; 100], &mut [0.0; 100]).is_err());
        assert!(filter.delay_s(15.0).is_err());
    }
}
