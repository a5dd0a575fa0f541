//! Detection and replacement of single positions that no motion can cause.

use super::CleaningSettings;
use super::outliers::{MIN_SAMPLES, NOISE_WINDOW, SIGMA_PER_MAD, gap_limit, median_size};
use crate::quantisation::{quantisation_step, usual_change};

const REACH: usize = 4;
/// Maximum RMS deviation of the fourth differences around a spike from the pattern of an ideal spike, relative to the
/// largest fourth difference. For a kink in the motion it is a sixth.
const MAX_PATTERN_ERROR: f64 = 0.08;
/// Limit of `MAX_PATTERN_ERROR` for small spikes, for which three standard deviations of the noise exceed that limit.
const MAX_PATTERN_ERROR_IN_NOISE: f64 = 0.14;

/// Replaces single spikes in the range `own` of `x` by the cubic through their four neighbours, and returns their
/// indices.
///
/// The fourth differences around a spike of size A are `A (1, -4, 6, -4, 1)`, around a jump `A (1, -3, 3, -1)`, and
/// around a kink `A (1, -2, 1)`. This pattern distinguishes a spike from a jump of the angle and from a sudden
/// acceleration. The size must exceed twelve robust standard deviations of the fourth differences nearby.
pub(crate) fn replace_spikes(x: &mut [f64], own: core::ops::Range<usize>, limits: &CleaningSettings) -> Vec<usize> {
    let n = x.len();
    if n < MIN_SAMPLES {
        return Vec::new();
    }
    let fourth = |x: &[f64], i: usize| {
        // Repeated differences keep the digits of positions that are far from zero.
        let d = [x[i - 1] - x[i - 2], x[i] - x[i - 1], x[i + 1] - x[i], x[i + 2] - x[i + 1]];
        (d[3] - d[2]) - 2.0 * (d[2] - d[1]) + (d[1] - d[0])
    };
    let all: Vec<f64> = (2..n - 2).map(|i| fourth(x, i)).collect();
    let overall = SIGMA_PER_MAD * median_size(all.iter().copied());
    // For each candidate its index, its size, the ratio to the minimum size, and whether the pattern is that of a
    // spike.
    let mut apart: Vec<(usize, f64, f64, bool)> = Vec::new();
    let inside = own.start.max(REACH)..own.end.min(n - REACH);
    let half = NOISE_WINDOW / 2;
    let mut from = inside.start;
    while from < inside.end {
        let to = (from + half).min(inside.end);
        let (low, high) = (from.saturating_sub(half / 2 + 2), (to + half / 2 - 2).min(all.len()));
        let noise = SIGMA_PER_MAD * median_size(all[low..high].iter().copied());
        let least = limits.spike_noise_ratio * f64::max(noise, 0.5 * overall);
        for i in from..to {
            let at = |k: usize| all[i + k - 4];
            let peak = at(2);
            let size = peak.abs();
            // Ignore rounding errors.
            if size <= 0.5 * least || size <= 1e-12 * x[i].abs() || (0..5).any(|k| at(k).abs() > size) {
                continue;
            }
            let rest = [at(0) - peak / 6.0, at(1) + peak / 1.5, at(3) + peak / 1.5, at(4) - peak / 6.0];
            let rest = (0.25 * rest.iter().map(|rest| rest * rest).sum::<f64>()).sqrt();
            let is_lone = rest
                < f64::max(
                    MAX_PATTERN_ERROR * size,
                    (3.0 / limits.spike_noise_ratio * least).min(MAX_PATTERN_ERROR_IN_NOISE * size),
                );
            apart.push((i, peak / 6.0, size / least, is_lone));
        }
        from = to.max(from + 1);
    }
    // If other roughness has the same size, it is noise with long tails and not a spike.
    let limit = gap_limit(apart.iter().map(|(_, _, times, is_lone)| if *is_lone { *times } else { times.min(1.0) }));
    let lone = apart.into_iter().filter(|(_, _, times, is_lone)| *is_lone && *times > limit);
    let mut found: Vec<(usize, f64)> = lone.map(|(i, size, ..)| (i, size)).collect();
    if found.is_empty() || found.len() as f64 > limits.max_spike_share * own.len() as f64 {
        return Vec::new();
    }
    if let Some(step) = quantisation_step(x) {
        found.retain(|(_, size)| size.abs() > limits.spike_steps * step);
    }
    // At rest, single encoder counts back and forth are not spikes.
    found.retain(|(i, size)| {
        let nearby = &x[i.saturating_sub(NOISE_WINDOW / 4)..(i + NOISE_WINDOW / 4).min(n)];
        usual_change(nearby).is_none_or(|change| size.abs() > limits.spike_steps * change)
    });
    for &(i, _) in &found {
        x[i] = (4.0 * (x[i - 1] + x[i + 1]) - x[i - 2] - x[i + 2]) / 6.0;
    }
    found.into_iter().map(|(i, _)| i).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::normal;

    fn replaced(x: &mut [f64]) -> Vec<usize> {
        let all = 0..x.len();
        replace_spikes(x, all, &CleaningSettings::default())
    }

    fn motion(i: usize) -> f64 {
        let t = i as f64 * 0.002;
        0.8 * (2.0 * t).sin() + 0.1 * (9.0 * t).cos()
    }

    #[test]
    fn a_spike_is_replaced_and_nothing_else_is_touched() {
        let n = 5000;
        for (sigma, spike) in [(0.0, 1e-3), (1e-5, 4e-4), (1e-4, 1.0)] {
            let noise = normal(5, n);
            let clean: Vec<f64> = (0..n).map(|i| motion(i) + sigma * noise[i]).collect();
            let mut x = clean.clone();
            assert!(replaced(&mut x).is_empty(), "{sigma}");
            let places = [700, 1500, 1510, 3333];
            for &i in &places {
                x[i] += if i % 2 == 0 { spike } else { -spike };
            }
            assert_eq!(replaced(&mut x), places, "{sigma}");
            for i in 0..n {
                // The cubic's noise is below σ; its bias is 9 h⁴ times the fourth derivative: 1e-9.
                assert!((x[i] - clean[i]).abs() < 8.0 * sigma + 1e-8, "{sigma} {i}");
            }
        }
    }

    #[test]
    fn jumps_of_an_angle_kinks_and_encoder_steps_are_no_spikes() {
        let n = 5000;
        let jump = |i: usize| motion(i) + if i > 2000 { 6.0 } else { 0.0 };
        let kink = |i: usize| motion(i) + (i as f64 - 2500.0).max(0.0) * 1e-4;
        let starts = |i: usize| (i as f64 - 2500.0).max(0.0).powi(2) * 1e-5;
        let encoder = |i: usize| (motion(i) / 1e-3).round() * 1e-3;
        // A joint at rest between two encoder counts, printed with five digits.
        let digits = |x: f64| format!("{x:.4e}").parse::<f64>().unwrap();
        let rest = |i: usize| {
            digits(
                if i < 2000 { motion(i) - motion(2000) } else { 0.0 } + if i.is_multiple_of(13) { 1e-5 } else { 0.0 },
            )
        };
        let signals: [&dyn Fn(usize) -> f64; 5] = [&jump, &kink, &starts, &encoder, &rest];
        for (which, signal) in signals.into_iter().enumerate() {
            let mut x: Vec<f64> = (0..n).map(signal).collect();
            assert_eq!(replaced(&mut x), Vec::<usize>::new(), "{which}");
        }
    }
}
