//! Estimation of the cut-off frequency: the frequency above which position noise exceeds the motion in the
//! acceleration.

use crate::error::{FilterError, require};
use realfft::RealFftPlanner;
use serde::{Deserialize, Serialize};

/// Share of the power of the velocity that its frequency band contains.
const VELOCITY_SHARE: f64 = 0.99;
pub(crate) const MAX_CUTOFF_SAMPLES: usize = 1 << 16;

/// Limits for the selection of a cut-off. They are not part of a study file.
#[derive(Clone, Debug, PartialEq)]
pub struct CutoffSettings {
    /// Share of the acceleration's power (noise subtracted) that is below the maximum frequency of the motion; it
    /// defines this frequency. 0.9999 by default.
    pub power_share: f64,
    /// Ratio of the cut-off to the maximum frequency of the motion, 2 by default. Zero-phase Butterworth filters of
    /// order 4 pass 99.6 % of the amplitude at half their cut-off, and 86 % at 0.8 of it. If positions are attenuated
    /// but torque is not, the fit is biased; the default limits the attenuation to 0.4 %.
    pub margin: f64,
    /// Minimum ratio of the position spectrum to the noise floor with which a joint is treated as moving, 10 by
    /// default; other joints are ignored.
    pub min_noise_ratio: f64,
    /// Maximum ratio of the cut-off to the sampling rate, 0.4 by default.
    pub max_rate_share: f64,
}

impl Default for CutoffSettings {
    fn default() -> Self {
        Self { power_share: 0.9999, margin: 2.0, min_noise_ratio: 10.0, max_rate_share: 0.4 }
    }
}

impl CutoffSettings {
    /// Checks the limits.
    ///
    /// # Errors
    /// A [`FilterError`] that names the setting.
    pub fn validate(&self) -> Result<(), FilterError> {
        let Self { power_share, margin, min_noise_ratio, max_rate_share } = *self;
        require(power_share > 0.0 && power_share < 1.0, "power_share", power_share, "give a number between 0 and 1")?;
        require(margin.is_finite() && margin >= 1.0, "margin", margin, "give a finite number, 1 or more")?;
        let fix = "give a finite number, 1 or more";
        require(min_noise_ratio.is_finite() && min_noise_ratio >= 1.0, "min_noise_ratio", min_noise_ratio, fix)?;
        let is_share = max_rate_share > 0.0 && max_rate_share < 0.5;
        require(is_share, "max_rate_share", max_rate_share, "give a number between 0 and 0.5")
    }
}

/// A selected cut-off with its reasons.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CutoffChoice {
    /// Cut-off of all joints, Hz.
    pub cutoff_hz: f64,
    /// Cut-off that each joint needs, Hz; `None` for a joint that does not move.
    pub joints_hz: Vec<Option<f64>>,
    /// Frequency above which the motion of each joint is smaller than its position noise, Hz; `None` for a joint that
    /// does not move.
    #[serde(default)]
    pub faded_hz: Vec<Option<f64>>,
    /// Frequency below which each joint has 99 % of its velocity's power (noise subtracted), Hz; `None` for a joint
    /// that does not move. It is not stored in files.
    #[serde(skip)]
    pub velocity_hz: Vec<Option<f64>>,
    /// The selection and its reason in one sentence.
    pub evidence: String,
}

/// Selects one cut-off for all joints from uniformly sampled positions `q` (one slice for each joint; at most the first
/// 65 536 samples are used).
///
/// For each joint, the Welch spectrum of the second difference of q is used, which is the acceleration except for a
/// factor (Hann window, three segments with half overlap):
/// * Position noise makes the spectrum of the acceleration rise with frequency. The valley is the frequency at which
///   the motion disappears in the noise: the first frequency above the peak of the velocity's spectrum at which the
///   acceleration's spectrum (smoothed over a quarter octave) falls below twice its minimum above this peak.
/// * If the recorder has filtered the positions, the valley is far above the motion. Therefore the cut-off for the
///   joint is twice the frequency below which 99.99 % of the acceleration's power up to the valley is contained.
///
/// The cut-off of the log is the maximum over the joints, at most 0.4 of the sample rate. A joint is ignored if its
/// spectrum never exceeds ten times the median over the upper half of the frequencies. If all joints are ignored, the
/// cut-off is a tenth of the rate.
pub fn cutoff<S: AsRef<[f64]>>(q: &[S], rate_hz: f64) -> CutoffChoice {
    cutoff_within(q, rate_hz, &CutoffSettings::default())
}

/// As [`cutoff`], with other limits than the defaults.
pub fn cutoff_within<S: AsRef<[f64]>>(q: &[S], rate_hz: f64, limits: &CutoffSettings) -> CutoffChoice {
    let CutoffSettings { margin, max_rate_share, .. } = *limits;
    let spectra: Vec<Option<Spectrum>> = q.iter().map(|q| spectrum(q.as_ref())).collect();
    let joints: Vec<Option<Content>> = spectra
        .iter()
        .map(|spectrum| spectrum.as_ref().and_then(|spectrum| content(spectrum, rate_hz, limits)))
        .collect();
    let highest = max_rate_share * rate_hz;
    let joint_cutoff_hz = |content: &Content| (margin * content.power_hz).min(highest);
    let leading = joints.iter().enumerate().filter_map(|(joint, content)| content.as_ref().map(|c| (joint, c)));
    let leading = leading.max_by(|a, b| a.1.power_hz.total_cmp(&b.1.power_hz));
    let joints_hz = joints.iter().map(|content| content.as_ref().map(joint_cutoff_hz)).collect();
    let faded_hz = joints.iter().map(|content| content.as_ref().map(|content| content.valley_hz)).collect();
    let velocity_hz = joints.iter().map(|content| content.as_ref().map(|content| content.velocity_hz)).collect();
    match leading {
        None => CutoffChoice {
            cutoff_hz: 0.1 * rate_hz,
            joints_hz,
            faded_hz,
            velocity_hz,
            evidence: "no joint moves above its noise: the cut-off is a tenth of the sampling rate".to_owned(),
        },
        Some((joint, content)) => CutoffChoice {
            cutoff_hz: joint_cutoff_hz(content),
            joints_hz,
            faded_hz,
            velocity_hz,
            evidence: format!(
                "joint {} (0-based) needs the highest cut-off: its acceleration falls below the noise ({:.1e} per \
                 sample of position) at {:.3} Hz, and 99.99 % of its power below that lies below {:.3} Hz; times \
                 {margin}, at most {max_rate_share} of the rate",
                joint, content.noise, content.valley_hz, content.power_hz,
            ),
        },
    }
}

struct Content {
    power_hz: f64,
    velocity_hz: f64,
    valley_hz: f64,
    /// Standard deviation of the position noise of one sample.
    noise: f64,
}

struct Spectrum {
    /// Spectrum of the second difference of the positions, from the second bin on.
    acceleration: Vec<f64>,
    /// Spectrum of the positions, from the second bin on.
    position: Vec<f64>,
    /// Variance of the position noise of one sample.
    floor: f64,
    /// Number of samples in a segment of the Welch spectrum.
    length: usize,
}

/// Squared gain of the second difference at bin `k` of `length`.
fn response(k: usize, length: usize) -> f64 {
    (2.0 * (core::f64::consts::PI * k as f64 / length as f64).sin()).powi(4)
}

fn spectrum(q: &[f64]) -> Option<Spectrum> {
    let q = &q[..q.len().min(MAX_CUTOFF_SAMPLES)];
    let (first, rest) = q.split_first()?;
    if q.len() < 64 || rest.iter().all(|x| x == first) || q.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let second: Vec<f64> = q.windows(3).map(|x| (x[2] - x[1]) - (x[1] - x[0])).collect();
    let length = previous_power_of_two(second.len() / 2).max(32);
    let power = welch(&second, length)?;
    let position: Vec<f64> = (1..power.len()).map(|k| power[k] / response(k, length)).collect();
    let mut upper = position[position.len() / 2..].to_vec();
    upper.sort_by(f64::total_cmp);
    let floor = upper[upper.len() / 2];
    Some(Spectrum { acceleration: power[1..].to_vec(), position, floor, length })
}

fn content(spectrum: &Spectrum, rate_hz: f64, limits: &CutoffSettings) -> Option<Content> {
    let Spectrum { acceleration, position, floor, length } = spectrum;
    let valley = valley(acceleration);
    let end = position.iter().rposition(|power| *power > limits.min_noise_ratio * floor)?.min(valley);
    let power: Vec<f64> = (0..=end).map(|k| ((position[k] - floor) * response(k + 1, *length)).max(0.0)).collect();
    let total: f64 = power.iter().sum();
    if position[0] <= limits.min_noise_ratio * floor || total <= 0.0 {
        return None;
    }
    let velocity: Vec<f64> = power.iter().enumerate().map(|(k, power)| power / ((k + 1) * (k + 1)) as f64).collect();
    let hertz = |k: usize| (k + 1) as f64 * rate_hz / *length as f64;
    Some(Content {
        power_hz: hertz(bin_below(&power, limits.power_share)),
        velocity_hz: hertz(bin_below(&velocity, VELOCITY_SHARE)),
        valley_hz: hertz(valley),
        noise: floor.sqrt(),
    })
}

/// First bin below which this share of the power is contained.
fn bin_below(power: &[f64], share: f64) -> usize {
    let total: f64 = power.iter().sum();
    let mut sum = 0.0;
    let is_reached = |power: &f64| {
        sum += power;
        sum >= share * total
    };
    power.iter().position(is_reached).unwrap_or(power.len() - 1)
}

/// Index (bin minus one) at which the acceleration's spectrum has fallen to twice its minimum above the main motion.
fn valley(acceleration: &[f64]) -> usize {
    let bins = acceleration.len();
    let sums: Vec<f64> = core::iter::once(0.0)
        .chain(acceleration.iter().scan(0.0, |sum, power| {
            *sum += power;
            Some(*sum)
        }))
        .collect();
    let smooth: Vec<f64> = (0..bins)
        .map(|k| {
            let (from, to) =
                (k.min(((k + 1) as f64 / 1.09) as usize), (((k + 1) as f64 * 1.09).ceil() as usize + 1).min(bins));
            let from = from.saturating_sub(1);
            (sums[to] - sums[from]) / (to - from) as f64
        })
        .collect();
    let velocity = |k: usize| smooth[k] / ((k + 1) * (k + 1)) as f64;
    let peak = (0..bins).max_by(|a, b| velocity(*a).total_cmp(&velocity(*b))).unwrap_or(0);
    let least = smooth[peak..].iter().fold(f64::INFINITY, |least, power| least.min(*power));
    peak + smooth[peak..].iter().position(|power| *power <= 2.0 * least).unwrap_or(0)
}

fn previous_power_of_two(n: usize) -> usize {
    n.checked_ilog2().map_or(1, |log| 1 << log)
}

/// Welch's power spectrum, scaled so that white noise of unit variance has 1 in each bin.
/// Source: Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70.
pub(crate) fn welch(signal: &[f64], length: usize) -> Option<Vec<f64>> {
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let window: Vec<f64> =
        (0..length).map(|i| 0.5 - 0.5 * (core::f64::consts::TAU * (i as f64 + 0.5) / length as f64).cos()).collect();
    let energy: f64 = window.iter().map(|w| w * w).sum();
    let (mut input, mut output) = (transform.make_input_vec(), transform.make_output_vec());
    let mut power = vec![0.0; output.len()];
    let (mut from, mut pieces) = (0, 0.0);
    while from + length <= signal.len() {
        for ((input, x), w) in input.iter_mut().zip(&signal[from..]).zip(&window) {
            *input = x * w;
        }
        transform.process(&mut input, &mut output).ok()?;
        for (power, bin) in power.iter_mut().zip(&output) {
            *power += bin.norm_sqr() / energy;
        }
        pieces += 1.0;
        from += length / 2;
    }
    for power in &mut power {
        *power /= pieces;
    }
    (pieces > 0.0).then_some(power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::sums_of_uniforms;
    use core::f64::consts::TAU;

    #[test]
    fn the_cutoff_lies_between_the_highest_harmonic_and_the_noise() {
        let (rate, n) = (500.0, 20_000);
        let noise = sums_of_uniforms(12345, n);
        for sigma in [0.0, 1e-6, 1e-4] {
            let q: Vec<f64> = (0..n)
                .map(|i| {
                    let t = i as f64 / rate;
                    (1..=5).map(|k| (TAU * 0.4 * f64::from(k) * t + f64::from(k)).sin() / f64::from(k)).sum::<f64>()
                        + sigma * noise[i]
                })
                .collect();
            let choice = cutoff(&[q], rate);
            // The highest harmonic is 2 Hz and has a third of the acceleration's power.
            assert!((2.0..6.0).contains(&choice.cutoff_hz), "sigma {sigma}: {choice:?}");
        }
    }

    #[test]
    fn joints_at_rest_are_ignored() {
        let q = [sums_of_uniforms(12345, 5000), vec![1.0; 5000]];
        let choice = cutoff(&q, 100.0);
        assert_eq!(choice.joints_hz, [None, None], "{choice:?}");
        assert_eq!(choice.cutoff_hz, 10.0);
        assert_eq!(cutoff::<Vec<f64>>(&[], 100.0).cutoff_hz, 10.0);
    }
}
