//! Butterworth low-pass filters, zero-phase and causal, with central differences of the filtered signal.

use super::differentiator::{Derivatives, Differentiator, Place, SampleRanges};
use crate::error::FilterError;
use crate::filter::sections::{Section, Triple, butterworth_low_pass, pole_radius, run};

/// Share of the signal to which transients at the end of a window must decay within
/// [`Differentiator::context_samples`].
const MAX_TRANSIENT_SHARE: f64 = 1e-15;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Cascade {
    order: usize,
    cutoff_hz: f64,
}

impl Cascade {
    fn new(order: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        // With a rate above twice the cut-off, only order and cut-off are checked.
        butterworth_low_pass(order, cutoff_hz, 4.0 * cutoff_hz)?;
        Ok(Self { order, cutoff_hz })
    }

    fn sections(&self, rate_hz: f64) -> Result<Vec<Section>, FilterError> {
        butterworth_low_pass(self.order, self.cutoff_hz, rate_hz)
    }

    /// Length of the odd extension at each end: three times the length of the filter, as in `sosfiltfilt`. It is longer
    /// than the three samples that the differences need.
    fn padding(&self) -> usize {
        3 * (self.order + 1)
    }

    fn context_samples(&self, rate_hz: f64) -> usize {
        let Ok(sections) = self.sections(rate_hz) else { return 0 };
        // The factor accounts for the amplification of transients by the cascade of sections.
        let decay = (MAX_TRANSIENT_SHARE.ln() / pole_radius(&sections).ln()).abs();
        (1.3 * decay).ceil() as usize + self.padding()
    }
}

/// Adds the first and second differences of a signal x: `d1[n] = x[n] - x[n-1]` and `d2[n] = d1[n+1] - d1[n]`. The
/// signal is constant before its start, so a forward run starts in the steady state of a constant, with zero
/// differences.
fn add_differences(signal: &mut [Triple]) {
    let last = signal.len() - 1;
    for n in (1..=last).rev() {
        signal[n][1] = signal[n][0] - signal[n - 1][0];
    }
    for n in 0..last {
        signal[n][2] = signal[n + 1][1] - signal[n][1];
    }
}

/// Runs the cascade of sections forwards from the steady state of the first value. The run of d2 is one sample ahead of
/// that of d1: its history starts with `d2[-1] = d1[0] - d1[-1] = 0`.
fn run_forwards(sections: &[Section], signal: &mut [Triple]) {
    let start = signal[0][0];
    run(sections, signal, [start, 0.0, 0.0], false);
}

fn run_backwards(sections: &[Section], signal: &mut [Triple]) {
    let end = signal[signal.len() - 1][0];
    run(sections, signal, [end, 0.0, 0.0], true);
}

/// Differentiator: a Butterworth low-pass that runs forwards and backwards (zero phase), then central differences.
///
/// Filtered position: `scipy.signal.sosfiltfilt(butter(order, cutoff_hz, fs=rate_hz, output="sos"), q)`, with its odd
/// extension of default length at both ends. The gain at the frequency f is
/// `1 / (1 + (tan(πf/rate)/tan(πf_c/rate))^(2 order))`, which is one half at the cut-off f_c.
///
/// Derivatives: central differences of sixth order of the filtered signal y, with δ²y = y₊ - 2y + y₋ and μδy = (y₊ -
/// y₋)/2. They include the extension of the signal, so that no one-sided formula is needed at the ends:
///
/// `dq = rate · (μδ - μδ³/6 + μδ⁵/30) y`,  `ddq = rate² · (δ² - δ⁴/12 + δ⁶/90) y`
///
/// The first and second differences of q are filtered by the same recursion as q. Because the filter is linear, the
/// result equals differences of y, but its rounding error is relative to the acceleration and not to the position. This
/// is necessary for logs at 5 kHz, for which two differences of y would lose eight digits. Source: Abramowitz and
/// Stegun, Handbook of Mathematical Functions, 25.3; Gustafsson, IEEE Trans. Signal Process. 44 (1996) 988.
pub type ButterworthZeroPhase = Butterworth<true>;

/// Differentiator: a Butterworth low-pass that runs forwards only (causal), then central differences of sixth order.
///
/// The gain at the frequency f is `1 / √(1 + (tan(πf/rate)/tan(πf_c/rate))^(2 order))`, which is 0.707 at the cut-off
/// f_c. The filter delays q, dq and ddq; the torque is delayed only if it is also filtered by
/// [`smooth`](Differentiator::smooth). If the regressor is later than the torque by δ, the fit has a relative error of
/// about ωδ at each frequency ω of the motion. Use this filter for comparison, and for logs whose torque was filtered
/// in the same way.
///
/// As in [`ButterworthZeroPhase`], the signal is extended at its start by a point-mirrored copy of three filter
/// lengths, and the run begins in the steady state. Source: Atkeson, An, Hollerbach, Int. J. Robotics Res. 5 (1986) 101
/// (filtered by a low-pass before differentiation); Oppenheim and Schafer, Discrete-Time Signal Processing, 7.1.2.
pub type LowPass = Butterworth<false>;

/// Butterworth low-pass with differentiation: a [`ButterworthZeroPhase`] if `BOTH_WAYS`, otherwise a [`LowPass`].
#[derive(Clone, Debug, PartialEq)]
pub struct Butterworth<const BOTH_WAYS: bool> {
    cascade: Cascade,
}

impl<const BOTH_WAYS: bool> Butterworth<BOTH_WAYS> {
    /// Creates a filter with the cut-off `cutoff_hz`; `order` is the order of a single run.
    ///
    /// # Errors
    /// If `order` is not 1 to 12 or the cut-off is not positive.
    pub fn new(order: usize, cutoff_hz: f64) -> Result<Self, FilterError> {
        Ok(Self { cascade: Cascade::new(order, cutoff_hz)? })
    }

    /// Cut-off of a single run, Hz. The gain of a forward and a backward run together is one half there.
    pub fn cutoff_hz(&self) -> f64 {
        self.cascade.cutoff_hz
    }

    /// The filtered signal, extended at both ends by the returned number of samples; with its differences if
    /// `differences` is true.
    fn filtered(&self, rate_hz: f64, signal: &[f64], differences: bool) -> Result<(Vec<Triple>, usize), FilterError> {
        self.check_length(signal.len())?;
        let (sections, pad) = (self.cascade.sections(rate_hz)?, self.cascade.padding());
        let mut signal = extended(signal, pad);
        if differences {
            add_differences(&mut signal);
        }
        run_forwards(&sections, &mut signal);
        if BOTH_WAYS {
            // The signal is constant beyond its end, so the second difference at the end is minus the first difference.
            let last = signal.len() - 1;
            signal[last][2] = -signal[last][1];
            run_backwards(&sections, &mut signal);
        }
        Ok((signal, pad))
    }
}

impl LowPass {
    /// Delay of slow signals, s: the group delay at zero frequency. For an analogue Butterworth filter of order n with
    /// the cut-off f_c it is `Σ_k sin(π(2k+1)/2n) / (2π f_c)`, for example 2.61/(2π f_c) for order 4.
    ///
    /// # Errors
    /// If the cut-off is not below half of `rate_hz`.
    pub fn delay_s(&self, rate_hz: f64) -> Result<f64, FilterError> {
        let sections = self.cascade.sections(rate_hz)?;
        // Group delay at zero frequency for H = B/A with unit gain: Σ k b_k / Σ b_k - Σ k a_k / Σ a_k.
        let delay = |section: &Section| {
            let ([b0, b1, b2], [a1, a2]) = (section.b, section.a);
            (b1 + 2.0 * b2) / (b0 + b1 + b2) - (a1 + 2.0 * a2) / (1.0 + a1 + a2)
        };
        Ok(sections.iter().map(delay).sum::<f64>() / rate_hz)
    }
}

impl<const BOTH_WAYS: bool> Differentiator for Butterworth<BOTH_WAYS> {
    fn name(&self) -> &'static str {
        if BOTH_WAYS { "butterworth" } else { "low-pass" }
    }

    fn context_samples(&self, rate_hz: f64) -> Option<usize> {
        Some(self.cascade.context_samples(rate_hz))
    }

    fn minimum_samples(&self) -> usize {
        self.cascade.padding() + 1
    }

    fn differentiate_at(&self, place: Place, q: &[f64], out: Derivatives<'_>) -> Result<SampleRanges, FilterError> {
        let (signal, pad) = self.filtered(place.rate_hz, q, true)?;
        for i in 0..q.len() {
            [out.q[i], out.dq[i], out.ddq[i]] = sixth_order(&signal, pad + i, place.rate_hz);
        }
        Ok(Vec::new())
    }

    fn smooth(&self, rate_hz: f64, input: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
        let (signal, pad) = self.filtered(rate_hz, input, false)?;
        for (out, value) in out.iter_mut().zip(&signal[pad..pad + input.len()]) {
            *out = value[0];
        }
        Ok(())
    }
}

/// Value, first and second derivative at sample `n` by central differences of sixth order, from the signal with its
/// backward first and central second differences.
fn sixth_order(signal: &[Triple], n: usize, rate_hz: f64) -> [f64; 3] {
    let d2 = |k: isize| signal[n.wrapping_add_signed(k)][2];
    let first = 0.5 * (signal[n][1] + signal[n + 1][1]);
    // μδ³, μδ⁵, δ⁴ and δ⁶ are computed from second differences.
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

/// The signal extended by `pad` samples on either side, point-mirrored at its end values: `2 x₀ - x_k`.
fn extended(signal: &[f64], pad: usize) -> Vec<Triple> {
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
        // Truncation of the sixth-order formulas: (ωh)⁶/140 = 3e-8 and /560 = 7e-9 of the derivative.
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
        // A cut-off too low for double precision.
        let slow = ButterworthZeroPhase::new(4, 1e-9).unwrap();
        assert!(slow.smooth(1000.0, &[0.0; 100], &mut [0.0; 100]).is_err());
        assert_eq!(slow.context_samples(1000.0), Some(0));
        assert!(ButterworthZeroPhase::new(4, -3.0).is_err());
    }

    #[test]
    fn a_sine_gets_the_gain_and_phase_of_the_filter() {
        // Independent reference: the transfer function as a product of analogue poles at the warped frequency.
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
        // Truncation of the sixth-order formulas: (ωh)⁶/140 = 1.3e-9 of the derivative. Transients have decayed by
        // half-way.
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
    fn a_ramp_is_delayed_by_the_group_delay() {
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
    fn a_causal_filter_refuses_bad_settings_and_short_signals() {
        assert!(LowPass::new(0, 1.0).is_err());
        assert!(LowPass::new(4, f64::NAN).is_err());
        let filter = LowPass::new(4, 10.0).unwrap();
        assert!(filter.smooth(500.0, &[0.0; 10], &mut [0.0; 10]).is_err());
        assert!(filter.smooth(15.0, &[0.0; 100], &mut [0.0; 100]).is_err());
        assert!(filter.delay_s(15.0).is_err());
    }
}
