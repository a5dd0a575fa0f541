//! From rows with stamps to pieces of samples on a uniform clock.
//!
//! [`Clock`] is the decision about the rate, and whether the stamps or the even spacing are to be believed. The
//! `Segmenter` then cuts a stream of rows at gaps, and its `Resampler` puts each piece on a grid of its own.

mod resampler;
pub(crate) mod segments;

use crate::log::ClockRule;
use serde::{Deserialize, Serialize};

/// Jitter below which the question of the clock is idle: standard deviation of the steps over their mean. At 0.1 % of a
/// step the position error of a wrong decision is a thousandth of the motion within one step.
pub(crate) const NEGLIGIBLE_JITTER: f64 = 1e-3;

/// Stamps closer together than this part of the mean step carry no information beside the noise: the second is left out
/// when stamps are interpolated.
pub(crate) const SHORTEST_STEP: f64 = 0.1;

/// What the first rows say about the clock.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Clock {
    /// Samples per second on the uniform grid.
    pub rate_hz: f64,
    /// Whether samples count as evenly spaced (the stamps only gave the mean rate).
    pub uniform: bool,
    /// Median step in seconds.
    pub median_step_s: f64,
    /// RMS error with which each position follows from its four neighbours by a cubic, relative to the motion, if the
    /// spacing is taken as even; `None` if the question was idle.
    pub misfit_uniform: Option<f64>,
    /// The same if the stamps are believed.
    pub misfit_stamps: Option<f64>,
    /// The decision in a sentence.
    pub evidence: String,
}

/// Decides on the clock from the stamps `time_s` and positions `q` (one slice for each joint) of the first rows.
///
/// Rule: with a jitter below [`NEGLIGIBLE_JITTER`] spacing is even. Otherwise every sample is predicted from its four
/// neighbours by the cubic through them, once at even spacing and once at the stamps; where sampling was regular and
/// only the stamps jitter (a time taken after transmission), the first predicts better, and the other way round. Stamps
/// are believed if they predict at least 10 % better.
///
/// `Err` holds the reason why no rate follows.
pub(crate) fn clock(
    rule: ClockRule,
    time_s: &[f64],
    row: &[u64],
    q: &[Vec<f64>],
    max_gap_steps: f64,
) -> Result<Clock, String> {
    let mut steps: Vec<f64> = (1..time_s.len())
        .filter(|i| row[*i] == row[i - 1] + 1)
        .map(|i| time_s[i] - time_s[i - 1])
        .filter(|step| *step > 0.0 && step.is_finite())
        .collect();
    if steps.is_empty() {
        return Err("no time step is positive".to_owned());
    }
    steps.sort_by(f64::total_cmp);
    let median = steps[steps.len() / 2];
    let usual = &steps[..steps.partition_point(|step| *step <= max_gap_steps * median)];
    let count = usual.len() as f64;
    let mean = usual.iter().sum::<f64>() / count;
    let deviation = (usual.iter().map(|step| (step - mean).powi(2)).sum::<f64>() / count).sqrt();
    let rate_hz = mean.recip();
    if !(rate_hz.is_finite() && rate_hz > 0.0 && rate_hz <= 1e9) {
        return Err(format!("the mean step is {mean} s"));
    }
    let jitter = deviation / mean;
    let mut result = Clock {
        rate_hz,
        uniform: true,
        median_step_s: median,
        misfit_uniform: None,
        misfit_stamps: None,
        evidence: String::new(),
    };
    let share = format!("{:.3} % jitter", 100.0 * jitter);
    if rule == ClockRule::Auto && jitter < NEGLIGIBLE_JITTER {
        result.evidence = format!("even spacing: {share} is negligible");
        return Ok(result);
    }
    let (uniform, stamps) = misfits(time_s, q, mean, max_gap_steps * median);
    result.misfit_uniform = Some(uniform);
    result.misfit_stamps = Some(stamps);
    result.uniform = match rule {
        ClockRule::Uniform => true,
        ClockRule::Stamps => false,
        ClockRule::Auto => stamps.partial_cmp(&(0.9 * uniform)) != Some(core::cmp::Ordering::Less),
    };
    let believed = if result.uniform { "even spacing" } else { "stamps" };
    let by = if rule == ClockRule::Auto {
        "decided by the misfit of a local cubic"
    } else {
        "as asked; misfit of a local cubic"
    };
    result.evidence = format!("{believed}, {by}: {uniform:.3e} evenly spaced, {stamps:.3e} at the stamps ({share})");
    Ok(result)
}

/// RMS misfit of the cubic through two neighbours on either side, over all joints in units of each joint's deviation.
fn misfits(time_s: &[f64], q: &[Vec<f64>], mean: f64, max_gap: f64) -> (f64, f64) {
    let (mut uniform, mut stamps, mut count) = (0.0, 0.0, 0.0);
    let scales: Vec<f64> = q.iter().map(|q| deviation(q)).collect();
    for i in 2..time_s.len().saturating_sub(2) {
        let nodes = [-2_isize, -1, 1, 2].map(|k| time_s[i.wrapping_add_signed(k)] - time_s[i]);
        let times = [nodes[0], nodes[1], 0.0, nodes[2], nodes[3]];
        let usual = times.windows(2).all(|pair| {
            let step = pair[1] - pair[0];
            step > SHORTEST_STEP * mean && step < max_gap
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
        clock(ClockRule::Auto, &time, &row, &q, 5.0).unwrap()
    }

    #[test]
    fn the_data_tell_whether_stamps_or_samples_jitter() {
        assert!(decided(false).uniform, "{:?}", decided(false));
        assert!(!decided(true).uniform, "{:?}", decided(true));
        assert!((decided(true).rate_hz - 200.0).abs() < 0.1);
    }

    #[test]
    fn no_rate_follows_from_a_clock_that_stands() {
        assert!(clock(ClockRule::Auto, &[0.0; 5], &[0, 1, 2, 3, 4], &[], 5.0).is_err());
        assert!(clock(ClockRule::Auto, &[0.0], &[0], &[], 5.0).is_err());
    }
}
