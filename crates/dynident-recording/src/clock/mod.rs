//! Conversion of rows with time stamps to pieces of samples on a uniform clock.
//!
//! [`Clock`] decides on the sample rate and on the times of the samples: the stamps, smoothed stamps (`drift`) or even
//! spacing. The `Timeline` assigns each row its place on the time axis, the `Segmenter` cuts the rows at gaps, and its
//! `Resampler` interpolates each piece on a separate grid.

mod drift;
mod resampler;
pub(crate) mod segments;
mod settings;
pub(crate) mod timeline;

pub use settings::ClockSettings;

use drift::{Drift, smoothed, windows};

use crate::log::ClockRule;
use serde::{Deserialize, Serialize};

/// Minimum distance between two stamps, as a share of the mean step. If two stamps are closer, their difference is
/// mostly noise, and the second sample is not used for interpolation.
pub(crate) const MIN_STEP_RATIO: f64 = 0.1;

/// Properties of the clock, estimated from the first rows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Clock {
    /// Sample rate of the uniform grid, Hz.
    pub rate_hz: f64,
    /// Whether samples are treated as evenly spaced (only the mean rate is taken from the stamps).
    pub uniform: bool,
    /// Median step, s.
    pub median_step_s: f64,
    /// Whether a row with the same stamp as the previous row is a copy of it and is ignored. If false, equal stamps
    /// result from rounding, and their rows have the usual spacing.
    #[serde(default)]
    pub repeats_rows: bool,
    /// RMS error with which the four neighbours of a position predict it by a cubic, for even spacing, relative to the
    /// motion; `None` if it was not needed.
    pub misfit_uniform: Option<f64>,
    /// RMS error with which the four neighbours of a position predict it by a cubic, for samples at their stamps,
    /// relative to the motion; `None` if it was not needed.
    pub misfit_stamps: Option<f64>,
    /// Range of the deviations of the smoothed stamps from an even grid, steps; `None` if it was not needed.
    #[serde(default)]
    pub drift_steps: Option<f64>,
    /// Number of rows over which stamps are smoothed by local lines; 0 if they are not smoothed.
    #[serde(default)]
    pub smoothing_rows: usize,
    /// The decision and its reason in one sentence.
    pub evidence: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Spacing {
    Even,
    Stamps,
    Smoothed,
}

impl Clock {
    pub(crate) fn spacing(&self) -> Spacing {
        match (self.uniform, self.smoothing_rows) {
            (true, _) => Spacing::Even,
            (false, 0) => Spacing::Stamps,
            (false, _) => Spacing::Smoothed,
        }
    }
}

/// Decides on the clock from the stamps `time_s` and positions `q` (one slice for each joint) of the first rows.
///
/// If the jitter is below [`negligible_jitter`](ClockSettings::negligible_jitter), the spacing is even. Otherwise two
/// questions are answered:
///
/// 1. Does each stamp show when its sample was taken? Every sample is predicted from its four neighbours by the cubic
///    through them, at even spacing and at the stamps. If only the stamps jitter (a time taken after transmission),
///    even spacing predicts better. The stamps are used if they predict at least 10 % better.
/// 2. Does the rate change slowly? A cubic over five samples cannot show this. If the smoothed stamps deviate from an
///    even grid by more than a step and the rate varies by more than 0.1 %, the smoothed stamps are used. The smoothing
///    window minimises the prediction error of left-out stamps, so that the drift is followed and jitter averaged out.
///
/// Equal stamps: if rows with the stamp of the previous row repeat its positions and other rows do not, they are copies
/// and take no time. Otherwise stamps are rounded to more than a step, and every row is included in the mean step.
///
/// All times are measured in steps, so the result does not depend on the unit of time. `Err` contains the reason why no
/// rate can be determined.
pub(crate) fn clock(
    rule: ClockRule,
    time_s: &[f64],
    row: &[u64],
    q: &[Vec<f64>],
    max_gap_steps: f64,
    limits: &ClockSettings,
) -> Result<Clock, String> {
    let steps = MeanStep::of(time_s, row, q, max_gap_steps, limits.min_repeat_share)?;
    let MeanStep { mean_s, median_s, rounded, repeats_rows, .. } = steps;
    let rate_hz = mean_s.recip();
    let mut result = Clock {
        rate_hz,
        uniform: true,
        median_step_s: median_s,
        repeats_rows,
        misfit_uniform: None,
        misfit_stamps: None,
        drift_steps: None,
        smoothing_rows: 0,
        evidence: String::new(),
    };
    let share = steps.describe_jitter(row.len());
    if rule == ClockRule::Auto && steps.jitter < limits.negligible_jitter {
        result.evidence = format!("even spacing: {share} is negligible");
        return Ok(result);
    }
    let (uniform, stamps) = misfits(time_s, q, mean_s, max_gap_steps * median_s);
    let drift = drift(time_s, row, q, rate_hz, max_gap_steps * median_s, limits);
    result.misfit_uniform = Some(uniform);
    result.misfit_stamps = Some(stamps);
    result.drift_steps = drift.map(|drift| drift.steps);
    let smoothing_rows = drift.map_or(0, |drift| 2 * drift.half + 1);
    // Rounded stamps deviate by the rounding step in either direction.
    let by_rounding = if rounded > 0 { 2.0 * median_s / mean_s } else { 0.0 };
    let stamps_predict_better =
        stamps.partial_cmp(&((1.0 - limits.min_improvement) * uniform)) == Some(core::cmp::Ordering::Less);
    (result.uniform, result.smoothing_rows) = match rule {
        ClockRule::Stamps => (false, 0),
        ClockRule::Smoothed => (false, smoothing_rows),
        ClockRule::Auto if stamps_predict_better => (false, 0),
        ClockRule::Auto if drift.is_some_and(|drift| drift.exceeds(limits) && drift.steps > by_rounding) => {
            (false, smoothing_rows)
        }
        ClockRule::Uniform | ClockRule::Auto => (true, 0),
    };
    let misfit = format!("misfit of a local cubic: {uniform:.3e} evenly spaced, {stamps:.3e} at the stamps ({share})");
    result.evidence = describe_decision(rule, &result, &misfit, drift);
    Ok(result)
}

/// Steps between successive rows, without gaps.
struct MeanStep {
    mean_s: f64,
    /// Median of the positive steps, including gaps.
    median_s: f64,
    /// Standard deviation of the steps divided by their mean.
    jitter: f64,
    /// Number of stamps that equal the previous one because of rounding.
    rounded: usize,
    /// Whether rows with the previous stamp are copies of the previous row.
    repeats_rows: bool,
}

impl MeanStep {
    fn of(
        time_s: &[f64],
        row: &[u64],
        q: &[Vec<f64>],
        max_gap_steps: f64,
        min_repeat_share: f64,
    ) -> Result<Self, String> {
        let successive = || (1..time_s.len()).filter(|i| row[*i] == row[i - 1] + 1);
        let all = successive().map(|i| time_s[i] - time_s[i - 1]);
        let mut steps: Vec<f64> = all.filter(|step| *step > 0.0 && step.is_finite()).collect();
        if steps.is_empty() {
            return Err("no time step is positive".to_owned());
        }
        steps.sort_by(f64::total_cmp);
        let median_s = steps[steps.len() / 2];
        let usual = &steps[..steps.partition_point(|step| *step <= max_gap_steps * median_s)];
        let equal: Vec<usize> = successive().filter(|i| time_s[*i] == time_s[i - 1]).collect();
        let repeats_rows = !equal.is_empty() && repeats_rows(q, &equal, successive(), min_repeat_share);
        let rounded = if repeats_rows { 0 } else { equal.len() };
        let usual = [&vec![0.0; rounded], usual].concat();
        let count = usual.len() as f64;
        let mean_s = usual.iter().sum::<f64>() / count;
        let deviation = (usual.iter().map(|step| (step - mean_s).powi(2)).sum::<f64>() / count).sqrt();
        let rate_hz = mean_s.recip();
        if !(rate_hz.is_finite() && rate_hz > 0.0 && rate_hz <= 1e9) {
            return Err(format!("the mean step is {mean_s} s"));
        }
        Ok(Self { mean_s, median_s, jitter: deviation / mean_s, rounded, repeats_rows })
    }

    fn describe_jitter(&self, stamps: usize) -> String {
        let by_rows = match self.rounded {
            0 => String::new(),
            rounded => {
                format!("; {rounded} of {stamps} stamps equal the one before: they are rounded, and all rows are used")
            }
        };
        format!("{:.3} % jitter{by_rows}", 100.0 * self.jitter)
    }
}

fn describe_decision(rule: ClockRule, clock: &Clock, misfit: &str, drift: Option<Drift>) -> String {
    let spacing = match clock.spacing() {
        Spacing::Even => "even spacing".to_owned(),
        Spacing::Stamps => "stamps".to_owned(),
        Spacing::Smoothed => format!("stamps smoothed over {} rows", clock.smoothing_rows),
    };
    let strays = drift.map_or_else(String::new, |drift| {
        let Drift { steps, variation, .. } = drift;
        format!("; the stamps drift {steps:.2} steps from an even grid, the rate varies by {:.2} %", 100.0 * variation)
    });
    match rule {
        ClockRule::Auto if clock.spacing() == Spacing::Smoothed => {
            format!("{spacing}, decided by the drift{strays}; {misfit}")
        }
        ClockRule::Auto => format!("{spacing}, decided by the {misfit}{strays}"),
        ClockRule::Uniform | ClockRule::Stamps | ClockRule::Smoothed => {
            format!("{spacing}, as configured; {misfit}{strays}")
        }
    }
}

/// Whether the rows `equal` repeat the positions of their previous rows, while most of `all` rows do not.
fn repeats_rows(q: &[Vec<f64>], equal: &[usize], all: impl Iterator<Item = usize>, min_share: f64) -> bool {
    let is_same = |i: usize| q.iter().all(|q| q[i] == q[i - 1]);
    let share = |rows: &mut dyn Iterator<Item = usize>| {
        let (same, count) = rows.fold((0_u32, 0_u32), |(same, count), i| (same + u32::from(is_same(i)), count + 1));
        f64::from(same) / f64::from(count.max(1_u32))
    };
    let others = &mut all.filter(|i| equal.binary_search(i).is_err());
    share(&mut equal.iter().copied()) > min_share && share(others) < 1.0 - min_share
}

/// Drift of the stamps from an even grid. The smoothing window minimises the prediction error for left-out stamps. It
/// is enlarged as long as positions are predicted clearly worse than with even spacing, because jitter over several
/// rows (packets that arrive late together) is not a change of the rate.
fn drift(
    time_s: &[f64],
    row: &[u64],
    q: &[Vec<f64>],
    rate_hz: f64,
    longest_step_s: f64,
    limits: &ClockSettings,
) -> Option<Drift> {
    let place: Vec<f64> = row.iter().map(|row| *row as f64).collect();
    let stamp: Vec<f64> = time_s.iter().map(|time_s| time_s * rate_hz).collect();
    let is_gap = |i: usize| {
        let step = time_s[i] - time_s[i - 1];
        step < 0.0 || step > longest_step_s
    };
    let begins: Vec<bool> = (0..row.len()).map(|i| i > 0 && is_gap(i)).collect();
    let mut found = None;
    for &half in windows(&place, &stamp, &begins) {
        found = Some(Drift::of(&place, &stamp, &begins, half));
        let smooth = smoothed(&place, &stamp, &begins, half);
        let (uniform, stamps) = misfits(&smooth, q, 1.0, longest_step_s * rate_hz);
        if stamps <= (1.0 + limits.min_improvement) * uniform {
            break;
        }
    }
    found
}

/// RMS error of predicting each position by the cubic through two neighbours on either side, over all joints, in units
/// of each joint's standard deviation: for even spacing and for samples at the stamps.
fn misfits(time_s: &[f64], q: &[Vec<f64>], mean: f64, max_gap: f64) -> (f64, f64) {
    let (mut uniform, mut stamps, mut count) = (0.0, 0.0, 0.0);
    let scales: Vec<f64> = q.iter().map(|q| deviation(q)).collect();
    for i in 2..time_s.len().saturating_sub(2) {
        let nodes = [-2_isize, -1, 1, 2].map(|k| time_s[i.wrapping_add_signed(k)] - time_s[i]);
        let times = [nodes[0], nodes[1], 0.0, nodes[2], nodes[3]];
        let usual = times.windows(2).all(|pair| {
            let step = pair[1] - pair[0];
            step > MIN_STEP_RATIO * mean && step < max_gap
        });
        if !usual {
            continue;
        }
        let weights = lagrange(0.0, nodes);
        for (q, scale) in q.iter().zip(&scales) {
            if *scale > 0.0 {
                let points = [q[i - 2], q[i - 1], q[i + 1], q[i + 2]];
                let at_stamps: f64 = weights.iter().zip(&points).map(|(w, x)| w * x).sum();
                let even = (4.0 * (points[1] + points[2]) - points[0] - points[3]) / 6.0;
                uniform += ((even - q[i]) / scale).powi(2);
                stamps += ((at_stamps - q[i]) / scale).powi(2);
                count += 1.0;
            }
        }
    }
    if count == 0.0 { (0.0, 0.0) } else { ((uniform / count).sqrt(), (stamps / count).sqrt()) }
}

fn deviation(values: &[f64]) -> f64 {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Weights of the cubic through values at four distinct `nodes`, evaluated at `at`.
pub(crate) fn lagrange(at: f64, nodes: [f64; 4]) -> [f64; 4] {
    let mut weights = [1.0; 4];
    for (i, weight) in weights.iter_mut().enumerate() {
        for (j, node) in nodes.iter().enumerate() {
            if i != j {
                *weight *= (at - node) / (nodes[i] - node);
            }
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto_clock(time_s: &[f64], row: &[u64], q: &[Vec<f64>]) -> Result<Clock, String> {
        clock(ClockRule::Auto, time_s, row, q, 5.0, &ClockSettings::default())
    }

    /// Time stamps with two decimals, of a recorder at 125 Hz (four steps of 10 ms for five rows) and at 200 Hz (one
    /// step for two rows).
    #[test]
    fn rounded_stamps_keep_the_rate_of_the_rows() {
        for rate_hz in [125.0, 200.0, 1000.0] {
            let time: Vec<f64> = (0..2000).map(|i| (f64::from(i) / rate_hz * 100.0).round() / 100.0).collect();
            let q: Vec<f64> = (0..2000).map(|i| (f64::from(i) / rate_hz * 4.0).sin()).collect();
            let row: Vec<u64> = (0..2000).collect();
            let found = auto_clock(&time, &row, &[q]).unwrap();
            assert!((found.rate_hz / rate_hz - 1.0).abs() < 2e-3, "{rate_hz}: {found:?}");
            assert!(found.uniform && !found.repeats_rows, "{found:?}");
        }
    }

    /// Copied rows are ignored in the rate. A robot at rest with rounded stamps also repeats its positions, but its
    /// rows are not copies.
    #[test]
    fn repeated_rows_are_distinguished_from_a_robot_at_rest() {
        let twice = |i: u32| f64::from(i / 2) * 0.008;
        let row: Vec<u64> = (0..2000).collect();
        let time: Vec<f64> = (0..2000).map(twice).collect();
        let q: Vec<f64> = time.iter().map(|t| (4.0 * t).sin()).collect();
        let found = auto_clock(&time, &row, &[q]).unwrap();
        assert!(found.repeats_rows && (found.rate_hz - 125.0).abs() < 1e-6, "{found:?}");
        let time: Vec<f64> = (0..2000).map(|i| (f64::from(i) * 0.8).round() / 100.0).collect();
        let found = auto_clock(&time, &row, &[vec![0.7; 2000]]).unwrap();
        assert!(!found.repeats_rows && (found.rate_hz / 125.0 - 1.0).abs() < 2e-3, "{found:?}");
    }

    /// A deterministic jitter in ±0.4 steps.
    fn jitter(i: usize) -> f64 {
        0.8 * ((i as f64 * 0.754_877_666).fract() - 0.5)
    }

    fn decided(sampled_at_stamps: bool) -> Clock {
        let n = 2000;
        let even = |i: usize| i as f64 * 0.005;
        let stamp = |i: usize| (i as f64 + jitter(i)) * 0.005;
        let time: Vec<f64> = (0..n).map(stamp).collect();
        let at = |i: usize| if sampled_at_stamps { stamp(i) } else { even(i) };
        let q = vec![(0..n).map(|i| (at(i) * 4.0).sin()).collect::<Vec<f64>>()];
        let row: Vec<u64> = (0..n as u64).collect();
        auto_clock(&time, &row, &q).unwrap()
    }

    #[test]
    fn jitter_of_stamps_and_of_samples_is_distinguished() {
        assert!(decided(false).uniform, "{:?}", decided(false));
        assert!(!decided(true).uniform, "{:?}", decided(true));
        assert!((decided(true).rate_hz - 200.0).abs() < 0.1);
    }

    /// The decision for samples taken at `taken(row)` steps and stamped `stamp(row)`, with position noise, for `unit`
    /// time units per second.
    fn decided_in(unit: f64, sigma: f64, taken: impl Fn(usize) -> f64, stamp: impl Fn(usize) -> f64) -> Clock {
        let n = 20_000;
        let noise = crate::derivative::test_signals::normal(4, n);
        let q: Vec<f64> = (0..n).map(|i| (taken(i) * 0.002).sin() + sigma * noise[i]).collect();
        let time: Vec<f64> = (0..n).map(|i| stamp(i) * 0.001 * unit).collect();
        let row: Vec<u64> = (0..n as u64).collect();
        auto_clock(&time, &row, &[q]).unwrap()
    }

    #[test]
    fn drift_is_followed_under_noise_that_hides_it_from_the_cubic() {
        // Blocks of 500 rows at rates that differ by some percent.
        let rate = |block: usize| 1.0 + 0.06 * (block as f64 * 2.4).sin();
        let taken = |i: usize| (0..i / 500).map(|b| 500.0 * rate(b)).sum::<f64>() + (i % 500) as f64 * rate(i / 500);
        for unit in [1e-3, 1.0, 1e3] {
            for sigma in [0.0, 1e-4] {
                let found = decided_in(unit, sigma, taken, |i| taken(i) + jitter(i));
                assert_eq!(found.spacing(), Spacing::Smoothed, "{unit} {sigma}: {found:?}");
                // The result is independent of the unit of time.
                let other = decided_in(1.0, sigma, taken, |i| taken(i) + jitter(i));
                assert_eq!(found.smoothing_rows, other.smoothing_rows, "{unit} {sigma}");
            }
        }
    }

    #[test]
    fn jitter_and_late_packets_on_an_even_grid_stay_even() {
        let even = |i: usize| i as f64;
        let late = |i: usize| (3.6 - 0.8 * (i % 50) as f64).max(0.0);
        for sigma in [0.0, 1e-6, 1e-4] {
            let jittered = decided_in(1.0, sigma, even, |i| even(i) + jitter(i));
            assert_eq!(jittered.spacing(), Spacing::Even, "{sigma}: {jittered:?}");
        }
        for sigma in [0.0, 1e-6, 1e-5] {
            let packets = decided_in(1.0, sigma, even, |i| even(i) + late(i));
            assert_eq!(packets.spacing(), Spacing::Even, "{sigma}: {packets:?}");
        }
    }

    #[test]
    fn a_stopped_clock_has_no_rate() {
        assert!(auto_clock(&[0.0; 5], &[0, 1, 2, 3, 4], &[]).is_err());
        assert!(auto_clock(&[0.0], &[0], &[]).is_err());
    }
}
