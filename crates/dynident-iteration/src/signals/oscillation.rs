//! Detection of oscillations of a joint: a signal that alternates far faster than any motion. Causes are, for
//! example, a control loop that is too fast for its delay, or a drive that switches between two torques.
//!
//! The moving mean over one period of the lowest frequency is subtracted. The signal then alternates if it passes the
//! thresholds `+h` and `-h` in turn. Oscillations are regular: over [`SWINGS`] alternations the lengths of periods
//! differ little. For noise, the lengths of periods vary by as much as their mean.

use dynident_model::Model;
use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Default of the lowest frequency of an oscillation, Hz, for an arm of 1.2 m: motions have frequencies up to about 2
/// Hz, and loops with some milliseconds of delay become unstable at 20 to 60 Hz.
const LOWEST_HZ: f64 = 8.0;
/// Number of consecutive alternations of an oscillation: eight periods.
pub(crate) const SWINGS: usize = 16;
/// Largest relative standard deviation of the periods of an oscillation (noise has 0.4 to 0.7). Rounding adds half a
/// sample, for periods of at least `MIN_ROUNDED_PERIOD` samples.
const MAX_PERIOD_VARIATION: f64 = 0.12;
const ROUNDING_SAMPLES: f64 = 0.5;
const MIN_ROUNDED_PERIOD: f64 = 5.0;
/// A run is stopped if the standard deviation of the logarithm of the ratio of consecutive peaks is at most this.
/// Noise has 0.4, a sine of five samples per period at most 0.2.
const MAX_PEAK_VARIATION: f64 = 0.25;
/// Ratio of the threshold to the root mean square of the signal. The peaks of a sine have a ratio of 1.4; two thirds
/// of noise samples are below 1.
const THRESHOLD_RMS_RATIO: f64 = 0.8;
/// Irregular alternations are an oscillation if they exceed this number of standard deviations of the noise.
const MIN_NOISE_SIGMAS: f64 = 6.0;
/// An oscillation decays if its last peaks are below this share of its first peaks.
const MIN_SUSTAINED_SHARE: f64 = 0.8;

/// Number of alternations at the end of a stopped run that are an oscillation, their threshold as a share of the
/// largest value, and the smallest ratio of consecutive peaks.
const MIN_LAST_SWINGS: usize = 5;
const LAST_SWINGS_THRESHOLD_SHARE: f64 = 0.005;
const MIN_PEAK_GROWTH: f64 = 0.9;

/// Settings of the detection of oscillations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct OscillationSettings {
    /// Lowest frequency of an oscillation, Hz; slower signals are part of the motion. Default 8 Hz for an arm of 1.2
    /// m, divided by the characteristic time of other arms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowest_hz: Option<f64>,
    /// Amplitude of a joint's velocity error at which a run is stopped, in percent of the joint's highest velocity in
    /// the motion. The oscillation must last eight consecutive periods without decaying. Default 10; 0 disables the
    /// stop.
    pub speed_percent: f64,
    /// Smallest amplitude of a torque oscillation that is reported, in percent of the joint torque (root mean
    /// square). Default 10.
    pub torque_percent: f64,
    /// Smallest percentage of oscillating samples that is reported. Default 2.
    pub time_percent: f64,
}

impl Default for OscillationSettings {
    fn default() -> Self {
        Self { lowest_hz: None, speed_percent: 10.0, torque_percent: 10.0, time_percent: 2.0 }
    }
}

impl OscillationSettings {
    /// Checks the numbers.
    ///
    /// # Errors
    /// Numbers out of range.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let lowest_hz = self.lowest_hz.unwrap_or(LOWEST_HZ);
        require(lowest_hz > 0.0 && lowest_hz <= 1e5, "oscillation.lowest_hz", lowest_hz, "give 0 to 100000 Hz")?;
        for (what, percent) in [
            ("speed_percent", self.speed_percent),
            ("torque_percent", self.torque_percent),
            ("time_percent", self.time_percent),
        ] {
            require((0.0..=1e3).contains(&percent), format!("oscillation.{what}"), percent, "give 0 to 1000")?;
        }
        Ok(())
    }

    /// Returns the limits at which a run is stopped; `None` if `speed_percent` is 0.
    pub fn limits(&self, model: &Model) -> Option<OscillationLimits> {
        let (lowest_hz, speed_share) = (self.lowest_hz(model), 0.01 * self.speed_percent);
        (speed_share > 0.0).then_some(OscillationLimits { lowest_hz, speed_share })
    }

    /// Returns the lowest frequency of an oscillation for this robot, Hz.
    pub fn lowest_hz(&self, model: &Model) -> f64 {
        self.lowest_hz.unwrap_or_else(|| model.characteristic_scale().hertz(LOWEST_HZ))
    }
}

/// Limits of a run; it is stopped if a joint oscillates beyond them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OscillationLimits {
    /// Lowest frequency of an oscillation, Hz.
    pub lowest_hz: f64,
    /// Smallest amplitude of the velocity error, as a share of the joint's highest velocity in the trajectory.
    pub speed_share: f64,
}

/// An oscillation of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Oscillation {
    /// Frequency, Hz: half the number of alternations per second.
    pub frequency_hz: f64,
    /// Mean peak value between alternations, in the unit of the signal: Nm (N) or rad/s (m/s).
    pub amplitude: f64,
    /// Share of oscillating samples, 0 to 1.
    pub share: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Search {
    pub(crate) lowest_hz: f64,
    /// Smallest amplitude, in the unit of the signal.
    pub(crate) least: f64,
    pub(crate) least_share: f64,
    /// Standard deviation of the signal's noise; 0 if unknown. In that case only regular oscillations are detected.
    pub(crate) noise: f64,
}

pub(crate) fn oscillation(values: &[f64], rate_hz: f64, search: Search) -> Option<Oscillation> {
    let half_period = half_period(rate_hz, search.lowest_hz)?;
    let swinging = without_mean(values, 2 * half_period);
    let rms = (swinging.iter().map(|x| x * x).sum::<f64>() / swinging.len().max(1) as f64).sqrt();
    let regular = swings(&swinging, search.least.max(THRESHOLD_RMS_RATIO * rms), half_period, |last| is_regular(last));
    let beyond = (search.noise > 0.0)
        .then(|| swings(&swinging, search.least.max(MIN_NOISE_SIGMAS * search.noise), half_period, |_| true))
        .flatten();
    let is_seen = |(samples, ..): &(usize, usize, f64)| *samples as f64 >= search.least_share * values.len() as f64;
    let found = regular.into_iter().chain(beyond).filter(is_seen);
    // The regular oscillation is preferred, unless the irregular one has more than twice as many samples.
    let (samples, alternations, peaks) = found.reduce(|one, other| if other.0 > 2 * one.0 { other } else { one })?;
    Some(Oscillation {
        frequency_hz: 0.5 * alternations as f64 * rate_hz / samples as f64,
        amplitude: peaks / alternations as f64,
        share: samples as f64 / values.len() as f64,
    })
}

/// Detects an oscillation that grows up to the end of the signal, as in a stopped run. Fewer alternations are
/// sufficient, because the run exceeded a limit. The amplitude is that of the last period.
pub(crate) fn growing_oscillation(values: &[f64], rate_hz: f64, lowest_hz: f64) -> Option<Oscillation> {
    let half_period = half_period(rate_hz, lowest_hz)?;
    let last_values = &values[values.len().saturating_sub(SWINGS * half_period)..];
    // Differences are used: relative to the mean over the last alternations, the first and far smaller alternations
    // would not be counted.
    let swinging: Vec<f64> = last_values.windows(2).map(|two| two[1] - two[0]).collect();
    let peak = swinging.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let mut counter = AlternationCounter::new(LAST_SWINGS_THRESHOLD_SHARE * peak, half_period);
    let mut newest = 0;
    for (sample, &x) in swinging.iter().enumerate() {
        if counter.add(x) {
            newest = sample;
        }
    }
    let last = &counter.last;
    let own = last.iter().skip(last.len().saturating_sub(MIN_LAST_SWINGS));
    let is_growing = own.clone().zip(own.clone().skip(1)).all(|(one, next)| next.peak >= MIN_PEAK_GROWTH * one.peak);
    let is_one = last.len() >= MIN_LAST_SWINGS
        && swinging.len() - newest <= half_period
        && is_regular(own.clone())
        && is_even(own.clone())
        && is_growing;
    let samples: usize = own.map(|one| one.length).sum();
    is_one.then(|| Oscillation {
        frequency_hz: 0.5 * MIN_LAST_SWINGS as f64 * rate_hz / samples as f64,
        amplitude: last_values.iter().rev().take(2 * half_period).fold(0.0_f64, |most, x| most.max(x.abs())),
        share: samples as f64 / values.len() as f64,
    })
}

/// Longest half period, samples; `None` if the sampling rate is too low for the lowest frequency.
fn half_period(rate_hz: f64, lowest_hz: f64) -> Option<usize> {
    let samples = 0.5 * rate_hz / lowest_hz;
    (samples.is_finite() && samples >= 1.0).then_some(samples.ceil() as usize)
}

/// Number of samples of the oscillations that `is_one` accepts, number of their alternations, and sum of their peaks.
fn swings(
    swinging: &[f64],
    threshold: f64,
    half_period: usize,
    is_one: impl Fn(&VecDeque<Alternation>) -> bool,
) -> Option<(usize, usize, f64)> {
    let mut counter = AlternationCounter::new(threshold, half_period);
    let (mut samples, mut alternations, mut peaks, mut counted_to) = (0, 0, 0.0, 0);
    for (sample, &x) in swinging.iter().enumerate() {
        if !counter.add(x) || counter.last.len() < SWINGS || !is_one(&counter.last) {
            continue;
        }
        for one in counter.last.iter().filter(|one| one.sample > counted_to) {
            samples += one.length.min(one.sample - counted_to);
            alternations += 1;
            peaks += one.peak;
        }
        counted_to = sample;
    }
    (alternations > 0 && samples > 0).then_some((samples, alternations, peaks))
}

#[derive(Clone, Copy, Debug)]
struct Alternation {
    /// The sample at which the signal passes the opposite threshold.
    sample: usize,
    length: usize,
    peak: f64,
}

/// Counts alternations between values above `threshold` and below `-threshold`.
#[derive(Debug)]
struct AlternationCounter {
    threshold: f64,
    longest: usize,
    sample: usize,
    /// The side on which the signal is (positive or not), the sample at which it got there, and the largest magnitude
    /// since.
    side: Option<(bool, usize, f64)>,
    /// The newest alternations; each follows the previous one within half a period of the lowest frequency.
    last: VecDeque<Alternation>,
}

impl AlternationCounter {
    fn new(threshold: f64, longest: usize) -> Self {
        Self { threshold, longest, sample: 0, side: None, last: VecDeque::with_capacity(SWINGS) }
    }

    fn add(&mut self, x: f64) -> bool {
        let sample = self.sample;
        self.sample += 1;
        let beyond = x.abs() > self.threshold;
        match &mut self.side {
            Some((positive, _, peak)) if beyond && *positive == (x > 0.0) => *peak = peak.max(x.abs()),
            Some((_, since, peak)) if beyond => {
                let new = Alternation { sample, length: sample - *since, peak: *peak };
                self.side = Some((x > 0.0, sample, x.abs()));
                if new.length > self.longest {
                    self.last.clear();
                    return false;
                }
                if self.last.len() == SWINGS {
                    self.last.pop_front();
                }
                self.last.push_back(new);
                return true;
            }
            None if beyond => self.side = Some((x > 0.0, sample, x.abs())),
            Some(_) | None => {}
        }
        false
    }
}

/// Whether the lengths of the periods (two alternations each) differ little.
fn is_regular<'a>(alternations: impl IntoIterator<Item = &'a Alternation>) -> bool {
    let lengths: Vec<f64> = alternations.into_iter().map(|one| one.length as f64).collect();
    let periods: Vec<f64> = lengths.windows(2).map(|two| two[0] + two[1]).collect();
    let mean = periods.iter().sum::<f64>() / periods.len().max(1) as f64;
    let square = periods.iter().map(|period| (period - mean).powi(2)).sum::<f64>() / periods.len().max(1) as f64;
    let rounding = if mean >= MIN_ROUNDED_PERIOD { ROUNDING_SAMPLES } else { 0.0 };
    !periods.is_empty() && square.sqrt() <= rounding.hypot(MAX_PERIOD_VARIATION * mean)
}

/// Whether consecutive peaks are of similar size or grow evenly.
fn is_even<'a>(alternations: impl IntoIterator<Item = &'a Alternation>) -> bool {
    let peaks: Vec<f64> = alternations.into_iter().map(|one| one.peak.ln()).collect();
    let steps: Vec<f64> = peaks.windows(2).map(|two| two[1] - two[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
    let square = steps.iter().map(|step| (step - mean).powi(2)).sum::<f64>() / steps.len().max(1) as f64;
    square.sqrt() <= MAX_PEAK_VARIATION
}

/// Subtracts the moving mean over `window` samples (fewer at the ends).
fn without_mean(values: &[f64], window: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(values.len() + 1);
    sums.push(0.0);
    for value in values {
        sums.push(sums[sums.len() - 1] + value);
    }
    let half = window / 2;
    let mean = |k: usize| {
        let (from, to) = (k.saturating_sub(half), (k + half + 1).min(values.len()));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    values.iter().enumerate().map(|(k, value)| value - mean(k)).collect()
}

#[derive(Debug)]
pub(crate) struct OscillationWatch {
    counter: AlternationCounter,
    rate_hz: f64,
    window: VecDeque<f64>,
    sum: f64,
    squares: VecDeque<f64>,
}

impl OscillationWatch {
    /// Creates a monitor for samples at `rate_hz`; `None` if the rate is too low for the lowest frequency.
    pub(crate) fn new(rate_hz: f64, lowest_hz: f64, least: f64) -> Option<Self> {
        let half_period = half_period(rate_hz, lowest_hz)?;
        let window = VecDeque::with_capacity(2 * half_period + 1);
        let counter = AlternationCounter::new(least, half_period);
        Some(Self { counter, rate_hz, window, sum: 0.0, squares: VecDeque::new() })
    }

    /// Adds a deviation from the trajectory; returns an oscillation if this sample completes one that does not decay.
    pub(crate) fn add(&mut self, deviation: f64) -> Option<Oscillation> {
        let length = 2 * self.counter.longest + 1;
        self.window.push_back(deviation);
        self.sum += deviation;
        if self.window.len() > length {
            self.sum -= self.window.pop_front().unwrap_or(0.0);
        }
        if self.window.len() < length {
            return None;
        }
        // The sample in the middle of the window; the result is half a period late.
        let x = self.window[length / 2] - self.sum / length as f64;
        self.squares.push_back(x * x);
        if self.squares.len() > SWINGS * self.counter.longest {
            self.squares.pop_front();
        }
        let completes = self.counter.add(x) && self.counter.last.len() == SWINGS;
        if !completes || !is_regular(&self.counter.last) || !is_even(&self.counter.last) {
            return None;
        }
        let last = &self.counter.last;
        let samples: usize = last.iter().map(|one| one.length).sum();
        // Noise exceeds the threshold only occasionally.
        let own = self.squares.iter().rev().take(samples);
        let rms = (own.sum::<f64>() / samples as f64).sqrt();
        let mean = |peaks: &mut dyn Iterator<Item = f64>| peaks.sum::<f64>() / (SWINGS / 4) as f64;
        let first = mean(&mut last.iter().take(SWINGS / 4).map(|one| one.peak));
        let newest = mean(&mut last.iter().rev().take(SWINGS / 4).map(|one| one.peak));
        (rms >= self.counter.threshold && newest >= MIN_SUSTAINED_SHARE * first).then(|| Oscillation {
            frequency_hz: 0.5 * SWINGS as f64 * self.rate_hz / samples as f64,
            amplitude: newest,
            share: samples as f64 / self.counter.sample as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;
    use dynident_model::sample::Random;

    const RATE_HZ: f64 = 500.0;

    /// Twenty seconds of a smooth torque with friction steps and noise.
    fn torque(noise: f64) -> Vec<f64> {
        let mut random = Random::new(5);
        let t = |k: usize| k as f64 / RATE_HZ;
        (0..10_000)
            .map(|k| {
                let speed = (TAU * 0.45 * t(k)).sin();
                20.0 * (TAU * 0.9 * t(k)).cos() + 6.0 * (speed / 0.002).tanh() + noise * random.normal()
            })
            .collect()
    }

    fn found(values: &[f64], noise: f64) -> Option<Oscillation> {
        oscillation(values, RATE_HZ, Search { lowest_hz: 8.0, least: 1.4, least_share: 0.02, noise })
    }

    /// Torque with friction and noise of realistic size is not an oscillation, whether the noise is white,
    /// differentiated as in a controller, or held over ten samples.
    #[test]
    fn an_honest_torque_does_not_oscillate() {
        for noise in [0.0, 0.05, 2.0, 20.0] {
            assert_eq!(found(&torque(noise), noise), None, "{noise}");
        }
        let white = torque(5.0);
        let differentiated: Vec<f64> = white.windows(2).map(|two| two[1] - two[0]).collect();
        assert_eq!(found(&differentiated, 7.0), None);
        let mut held = 0.0;
        let mut random = Random::new(6);
        let coloured: Vec<f64> = (0..10_000)
            .map(|_| {
                held = 0.9 * held + 2.0 * random.normal();
                held
            })
            .collect();
        assert_eq!(found(&coloured, 4.0), None);
    }

    /// An oscillation in a fifth of the samples is detected with its frequency, amplitude and share: a sine of 43 Hz,
    /// alternation from sample to sample, or random switching between two torques.
    #[test]
    fn a_joint_that_chatters_is_found() {
        let with = |swing: &mut dyn FnMut(usize) -> f64| -> Vec<f64> {
            let chatters = |k: usize| (4000..6000).contains(&k);
            torque(0.05).into_iter().enumerate().map(|(k, x)| if chatters(k) { x + swing(k) } else { x }).collect()
        };
        let sine = found(&with(&mut |k| 16.0 * (TAU * 43.0 * k as f64 / RATE_HZ).sin()), 0.05).unwrap();
        assert!((sine.frequency_hz - 43.0).abs() < 1.0, "{sine:?}");
        assert!((sine.share - 0.2).abs() < 0.02 && (sine.amplitude - 16.0).abs() < 1.5, "{sine:?}");
        let switched = found(&with(&mut |k| if k % 2 == 0 { 16.0 } else { -16.0 }), 0.05).unwrap();
        assert!((switched.frequency_hz - 250.0).abs() < 3.0 && (switched.share - 0.2).abs() < 0.02, "{switched:?}");
        let mut random = Random::new(7);
        let at_random = found(&with(&mut |_| if random.bits() & 1 == 0 { 16.0 } else { -16.0 }), 0.05).unwrap();
        assert!((at_random.share - 0.2).abs() < 0.02 && at_random.amplitude > 10.0, "{at_random:?}");
    }

    /// A loop that oscillates at constant amplitude is detected within ten periods. A decaying oscillation and noise of
    /// any size are not reported.
    #[test]
    fn a_running_joint_is_watched() {
        let seen = |deviation: &mut dyn FnMut(f64) -> f64| {
            let mut watch = OscillationWatch::new(RATE_HZ, 8.0, 0.1).unwrap();
            (0..5000).find_map(|k| Some((k, watch.add(deviation(f64::from(k) / RATE_HZ))?)))
        };
        let (sample, found) = seen(&mut |t| 0.3 * (TAU * 43.0 * t).sin()).unwrap();
        assert!((found.frequency_hz - 43.0).abs() < 1.0 && (found.amplitude - 0.3).abs() < 0.03, "{found:?}");
        assert!(sample < 180, "{sample}");
        assert!(seen(&mut |t| 1e-3 * (8.0 * t).exp().min(500.0) * (TAU * 30.0 * t).sin()).is_some());
        assert_eq!(seen(&mut |t| 2.0 * (-8.0 * t).exp() * (TAU * 43.0 * t).sin()), None);
        assert_eq!(seen(&mut |t| 0.5 * (TAU * 2.0 * t).sin()), None);
        for seed in 0..20 {
            for size in [0.07, 0.15, 0.3, 3.0] {
                let mut random = Random::new(seed);
                assert_eq!(seen(&mut |_| size * random.normal()), None, "{seed}, {size}");
                let mut before = 0.0;
                let mut differentiated = |_| {
                    let new = size * random.normal();
                    new - core::mem::replace(&mut before, new)
                };
                assert_eq!(seen(&mut differentiated), None, "{seed}, {size}");
            }
        }
    }

    /// The last alternations of a run that a velocity limit ended; a joint that runs away or is only noisy does not
    /// oscillate.
    #[test]
    fn a_growing_oscillation_is_named() {
        let grows = |t: f64| 1e-3 * (20.0 * t).exp() * (TAU * 43.0 * t).sin();
        let values: Vec<f64> = (0..200).map(|k| grows(f64::from(k) / RATE_HZ)).collect();
        let found = growing_oscillation(&values, RATE_HZ, 8.0).unwrap();
        assert!((found.frequency_hz - 43.0).abs() < 2.0, "{found:?}");
        let away: Vec<f64> = (0..200).map(|k| 1e-3 * (20.0 * f64::from(k) / RATE_HZ).exp()).collect();
        assert_eq!(growing_oscillation(&away, RATE_HZ, 8.0), None);
        for seed in 0..20 {
            let mut random = Random::new(seed);
            let noisy: Vec<f64> = away.iter().map(|x| x + random.normal()).collect();
            assert_eq!(growing_oscillation(&noisy, RATE_HZ, 8.0), None, "{seed}");
        }
        assert_eq!(growing_oscillation(&[], RATE_HZ, 8.0), None);
    }
}
