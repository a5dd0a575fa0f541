//! Detection of single torque samples that are far from their neighbours.

use super::CleaningSettings;
use crate::quantisation::quantisation_step;

/// Number of samples in a group, of which the median is used.
const GROUP: usize = 5;
/// Number of samples needed on either side of a tested sample: two groups.
const REACH: usize = 2 * GROUP;
/// Number of samples over which the noise is assumed stationary.
pub(super) const NOISE_WINDOW: usize = 512;
/// Factor on the minimum distance of an outlier near an end of the log, where a line through ten samples is
/// extrapolated.
const END_FACTOR: f64 = 4.0;
/// Minimum ratio of an outlier near an end of the log to the usual change between samples nearby. (A controller that
/// settles there oscillates.)
const END_CHANGE_RATIO: f64 = 2.0;
const NEIGHBOURS: usize = 3;
/// Maximum share of outliers that directly follow another outlier. If the share is larger, the deviations are pulses of
/// the real torque.
const MAX_ADJACENT_SHARE: f64 = 0.2;
/// Minimum number of outliers for which `MAX_ADJACENT_SHARE` is used.
const MIN_OUTLIERS_FOR_PULSES: usize = 10;
/// Number of adjacent samples that form a pulse of the real torque (a contact, a drive that catches up), if all deviate
/// in the same direction.
const PULSE_SAMPLES: usize = 3;
/// Minimum deviation of each sample of a pulse, as a share of the deviation of the tested sample.
const MIN_PULSE_SHARE: f64 = 0.25;
pub(super) const MIN_SAMPLES: usize = 64;
/// Ratio of the standard deviation to the median absolute deviation of normal noise.
pub(super) const SIGMA_PER_MAD: f64 = 1.4826;

/// Indices of the outliers in the range `own` of `x`; the rest of `x` are neighbouring samples.
///
/// For each tested sample, the medians of two groups of five samples before it and of two groups after it are used; a
/// median tolerates two outliers in its group. The cubic through the four medians estimates a smooth torque. The line
/// through the two medians before, and the line through the two after, estimate the torque on either side of a step
/// (friction reversal, contact). A sample is an outlier if its distance from the range of these three estimates exceeds
/// three limits: eight robust standard deviations of the nearby samples from their cubics, 0.5 % of the torque's
/// spread, and 3.5 steps of a quantised channel. Source of the median rule: Hampel, J. Am. Stat. Assoc. 69 (1974) 383;
/// Davies and Gather, J. Am. Stat. Assoc. 88 (1993) 782. The groups and the test for steps are extensions of Dynident.
pub(super) fn outliers(x: &[f64], own: core::ops::Range<usize>, spread: f64, limits: &CleaningSettings) -> Vec<usize> {
    if x.len() < MIN_SAMPLES {
        return Vec::new();
    }
    let around = Surroundings::of(x);
    let far = around.far_samples(own.clone(), spread, limits);
    let limit = gap_limit(far.iter().map(|sample| sample.times));
    let mut found: Vec<usize> = far.iter().filter(|far| far.times > limit).map(|far| far.sample).collect();
    if found.is_empty() || found.len() as f64 > limits.max_outlier_share * own.len() as f64 {
        return Vec::new();
    }
    // Errors of a recorder are isolated; repeated deviations over several samples are real torque.
    let beside = (1..found.len()).filter(|&k| found[k] == found[k - 1] + 1).count();
    if found.len() >= MIN_OUTLIERS_FOR_PULSES && beside as f64 > MAX_ADJACENT_SHARE * found.len() as f64 {
        return Vec::new();
    }
    if let Some(step) = quantisation_step(x) {
        found.retain(|&i| around.outside(i) > limits.outlier_steps * step);
    }
    found.retain(|&i| !around.is_pulse(i));
    found
}

/// The samples, and for each sample the estimates from the medians of the groups around it.
struct Surroundings<'a> {
    x: &'a [f64],
    /// Medians of five successive samples, extrapolated at the ends of the log.
    medians: Vec<f64>,
    /// Distance of each sample from the cubic through the four medians.
    off: Vec<f64>,
}

struct FarSample {
    sample: usize,
    /// Distance of the sample divided by the minimum distance of an outlier.
    times: f64,
}

impl<'a> Surroundings<'a> {
    fn of(x: &'a [f64]) -> Self {
        let n = x.len();
        // The signal is extended at its ends by point reflection on the line through the two groups next to the end.
        // This preserves a slope, and the last sample, which may be an outlier, has no effect.
        let end = |at: &dyn Fn(usize) -> f64| {
            let [near, far] =
                [1, 1 + GROUP].map(|from| median_of_five(&core::array::from_fn::<f64, GROUP, _>(|k| at(from + k))));
            near + 0.6 * (near - far)
        };
        let (first, last) = (end(&|k| x[k]), end(&|k| x[n - 1 - k]));
        let before = (1..=REACH).rev().map(|k| 2.0 * first - x[k]);
        let behind = (1..=REACH).map(|k| 2.0 * last - x[n - 1 - k]);
        let padded: Vec<f64> = before.chain(x.iter().copied()).chain(behind).collect();
        let medians = padded.windows(GROUP).map(median_of_five).collect();
        let mut around = Self { x, medians, off: Vec::new() };
        // Value at 0 of the cubic through values at -8, -3, 3 and 8.
        let smooth =
            |[far, before, behind, beyond]: [f64; 4]| 32.0 / 55.0 * (before + behind) - 9.0 / 110.0 * (far + beyond);
        around.off = (0..n).map(|i| x[i] - smooth(around.medians_around(i))).collect();
        around
    }

    /// Medians of the two groups before sample `i` and of the two after it.
    fn medians_around(&self, i: usize) -> [f64; 4] {
        let place = i + REACH;
        [place - 2 * GROUP, place - GROUP, place + 1, place + 1 + GROUP].map(|from| self.medians[from])
    }

    /// Signed distance of sample `k` from the range of the estimates for sample `i`; zero inside the range.
    fn signed(&self, i: usize, k: usize) -> f64 {
        let x = self.x;
        let usual = usual_range(self.medians_around(i), x[i] - self.off[i]);
        (x[k] - usual.end).max(0.0) - (usual.start - x[k]).max(0.0)
    }

    fn outside(&self, i: usize) -> f64 {
        self.signed(i, i).abs()
    }

    /// Minimum distance of an outlier near an end of the log, where samples are known on one side only. It grows with
    /// the change between samples, so that an oscillating signal has no outliers there.
    fn least_at_an_end(&self, i: usize, least: f64) -> f64 {
        let n = self.x.len();
        if (REACH..n - REACH).contains(&i) {
            return 0.0;
        }
        let nearby = i.saturating_sub(GROUP)..(i + GROUP).min(n - 1);
        let nearby = nearby.filter(|k| *k != i && k + 1 != i);
        let changes = median_size(nearby.map(|k| self.x[k + 1] - self.x[k]));
        f64::max(END_FACTOR * least, END_CHANGE_RATIO * changes)
    }

    fn far_samples(&self, own: core::ops::Range<usize>, spread: f64, limits: &CleaningSettings) -> Vec<FarSample> {
        let (x, off, n) = (self.x, &self.off, self.x.len());
        let overall = SIGMA_PER_MAD * median_size(off.iter().copied());
        let mostly_repeats = 2 * x.windows(2).filter(|pair| pair[0] == pair[1]).count() > n;
        let mut far = Vec::new();
        let half = NOISE_WINDOW / 2;
        let mut from = own.start;
        while from < own.end {
            let to = (from + half).min(own.end);
            let (low, high) = (from.saturating_sub(half / 2), (to + half / 2).min(n));
            let noise = f64::max(SIGMA_PER_MAD * median_size(off[low..high].iter().copied()), 0.5 * overall);
            // If most samples lie exactly on a line, the noise estimate is invalid, and the spread is used instead.
            let share = if noise > 0.0 && !mostly_repeats { limits.outlier_spread_share } else { 2.0 };
            let least = f64::max(limits.outlier_noise_ratio * noise, share * spread).max(f64::MIN_POSITIVE);
            for i in from..to {
                if off[i].abs() > 0.5 * least {
                    let nearby = i.saturating_sub(NEIGHBOURS)..(i + NEIGHBOURS + 1).min(n);
                    let usual = limits.outlier_neighbour_ratio * median_size(nearby.map(|k| self.outside(k)));
                    let usual = usual.max(self.least_at_an_end(i, least));
                    far.push(FarSample { sample: i, times: self.outside(i) / least.max(usual) });
                }
            }
            from = to;
        }
        far
    }

    fn is_pulse(&self, i: usize) -> bool {
        let beside = |k: &usize| self.signed(i, *k) / self.signed(i, i) > MIN_PULSE_SHARE;
        let before = (0..i).rev().take(PULSE_SAMPLES).take_while(beside).count();
        let behind = (i + 1..self.x.len()).take(PULSE_SAMPLES).take_while(beside).count();
        before + 1 + behind >= PULSE_SAMPLES
    }
}

/// Limit above which distances are clearly separated from noise: the smallest power of two (at least 1) with more
/// `distances` above it than between half of it and itself. Distances are in units of the minimum distance of an
/// outlier. Errors of a recorder are separated from the noise by a gap; noise with long tails has no such gap.
pub(super) fn gap_limit(distances: impl Iterator<Item = f64>) -> f64 {
    let distances: Vec<f64> = distances.collect();
    let mut limit = 1.0;
    loop {
        let beyond = distances.iter().filter(|distance| **distance > limit).count();
        let below = distances.iter().filter(|distance| **distance > 0.5 * limit && **distance <= limit).count();
        if beyond == 0 || beyond > below {
            return limit;
        }
        limit *= 2.0;
    }
}

/// Range of three estimates at 0 from the medians at -8, -3, 3 and 8: the line through the first two, the line through
/// the last two, and the cubic through all.
fn usual_range(values: [f64; 4], smooth: f64) -> core::ops::Range<f64> {
    let [far, before, behind, beyond] = values;
    let suggested = [before + 0.6 * (before - far), behind + 0.6 * (behind - beyond), smooth];
    let low = suggested.iter().fold(f64::INFINITY, |low, value| low.min(*value));
    low..suggested.iter().fold(f64::NEG_INFINITY, |high, value| high.max(*value))
}

/// Replaces the marked samples by the straight line between the nearest unmarked samples.
pub(super) fn interpolate_marked(x: &mut [f64], marked: &[usize]) {
    let mut at = 0;
    while at < marked.len() {
        let mut last = at;
        while last + 1 < marked.len() && marked[last + 1] == marked[last] + 1 {
            last += 1;
        }
        let (first, end) = (marked[at], marked[last] + 1);
        let before = first.checked_sub(1).map(|k| x[k]);
        let behind = x.get(end).copied();
        let (from, to) = (before.or(behind).unwrap_or(0.0), behind.or(before).unwrap_or(0.0));
        let steps = (end - first + 1) as f64;
        for (k, value) in x[first..end].iter_mut().enumerate() {
            *value = from + (to - from) * (k + 1) as f64 / steps;
        }
        at = last + 1;
    }
}

/// Median of the absolute values; zero without values.
pub(super) fn median_size(values: impl Iterator<Item = f64>) -> f64 {
    // The bit patterns of nonnegative floats have the same order as the floats, and they compare faster.
    let mut sizes: Vec<u64> = values.map(|value| value.abs().to_bits()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let half = sizes.len() / 2;
    f64::from_bits(*sizes.select_nth_unstable(half).1)
}

fn median_of_five(x: &[f64]) -> f64 {
    let (a, b) = (x[0].min(x[1]), x[0].max(x[1]));
    let (c, d) = (x[2].min(x[3]), x[2].max(x[3]));
    // The smaller of the two minima and the larger of the two maxima cannot be the median of five.
    let (low, high) = (a.max(c), b.min(d));
    low.min(high).max(low.max(high).min(x[4]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::normal;

    fn found(x: &[f64]) -> Vec<usize> {
        let mut sorted = x.to_vec();
        sorted.sort_by(f64::total_cmp);
        let spread = sorted[19 * x.len() / 20] - sorted[x.len() / 20];
        outliers(x, 0..x.len(), spread, &CleaningSettings::default())
    }

    /// Torque with gravity, inertia and dry friction.
    fn torque(i: usize) -> f64 {
        let t = i as f64 * 0.004;
        30.0 * (0.7 * t).sin() + 5.0 * (3.1 * t).cos() + 4.0 * (1.3 * t).sin().signum()
    }

    #[test]
    fn the_middle_of_five() {
        for order in [[1.0, 2.0, 3.0, 4.0, 5.0], [5.0, 1.0, 4.0, 2.0, 3.0], [3.0, 5.0, 1.0, 4.0, 2.0]] {
            assert_eq!(median_of_five(&order), 3.0, "{order:?}");
        }
        assert_eq!(median_of_five(&[2.0, 2.0, 2.0, 9.0, -9.0]), 2.0);
    }

    #[test]
    fn twenty_sigma_is_found_and_nothing_else() {
        let n = 20_000;
        let noise = normal(7, n);
        let clean: Vec<f64> = (0..n).map(|i| torque(i) + 0.1 * noise[i]).collect();
        // Normal noise exceeds eight deviations in two of ten million samples.
        assert!(found(&clean).is_empty(), "{:?}", found(&clean));
        let pick = normal(8, n);
        // The upper 5 % of a normal sample.
        let spoilt: Vec<usize> = (0..n).filter(|i| pick[*i] > 1.645).collect();
        let mut x = clean;
        for &i in &spoilt {
            x[i] += if i % 2 == 0 { 2.0 } else { -2.0 };
        }
        let found = found(&x);
        assert!(found.iter().all(|i| spoilt.contains(i)), "{} of {}", found.len(), spoilt.len());
        // In 0.1 % of the groups, three of five neighbours are outliers.
        assert!(found.len() as f64 > 0.97 * spoilt.len() as f64, "{} of {}", found.len(), spoilt.len());
    }

    #[test]
    fn ends_on_a_slope_are_valid_and_an_outlier_at_an_end_is_found() {
        for from in (0..4000).step_by(37) {
            // Without dry friction: for a jump close to an end of the log, samples exist on one side only.
            let smooth = |i: usize| torque(i) - 4.0 * (1.3 * i as f64 * 0.004).sin().signum();
            let mut x: Vec<f64> = (from..from + 300).map(smooth).collect();
            assert!(found(&x).is_empty(), "{from}: {:?}", found(&x));
            x[0] += 30.0;
            x[299] -= 30.0;
            assert_eq!(found(&x), [0, 299], "{from}");
        }
    }

    #[test]
    fn long_tails_are_kept_and_isolated_outliers_are_found() {
        let n = 20_000;
        let (a, b) = (normal(13, n), normal(14, n));
        // Noise with long tails, close to Student's t with 1.5 degrees of freedom: a normal variable divided by a power
        // of another.
        let mut x: Vec<f64> = (0..n).map(|i| torque(i) + 0.1 * a[i] / b[i].abs().powf(0.7).max(0.01)).collect();
        let few = found(&x).len();
        // About 0.1 % of the samples exceed eight deviations; only the farthest are flagged.
        assert!(few < 10, "{few}");
        x[777] = 1e9;
        assert!(found(&x).contains(&777));
    }

    #[test]
    fn coloured_noise_exact_torque_steps_and_oscillations_are_kept() {
        let n = 20_000;
        let noise = normal(3, n);
        let mut last = 0.0;
        let coloured = |share: f64, last: &mut f64| -> Vec<f64> {
            (0..n)
                .map(|i| {
                    *last = share * *last + noise[i];
                    torque(i) + 0.1 * *last
                })
                .collect()
        };
        for share in [0.5, 0.95, -0.7] {
            assert!(found(&coloured(share, &mut last)).is_empty(), "{share}");
        }
        assert!(found(&(0..n).map(torque).collect::<Vec<f64>>()).is_empty());
        let quantised: Vec<f64> = (0..n).map(|i| ((torque(i) + 0.02 * noise[i]) / 0.5).round() * 0.5).collect();
        assert!(found(&quantised).is_empty());
        // A controller that oscillates during the first samples, as on a Panda.
        let swing = [-11.0, 8.0, -6.0, 5.5, -5.0, -9.0, 4.0, 1.0];
        let swings: Vec<f64> =
            (0..500).map(|i| 0.3 * torque(i) + swing.get(i).copied().unwrap_or(0.02 * noise[i])).collect();
        assert!(found(&swings).is_empty(), "{:?}", found(&swings));
        // An impact that decays within a few samples.
        let blow = |i: usize| if i % 700 < 8 && i > 8 { 6.0 * (-0.3 * (i % 700) as f64).exp() } else { 0.0 };
        let blows: Vec<f64> = (0..3000).map(|i| torque(i) + 0.02 * noise[i] + blow(i)).collect();
        assert!(found(&blows).is_empty(), "{:?}", found(&blows));
        let blunt: Vec<f64> = (0..n).map(|i| torque(i) + 8.0 * (i as f64 * 0.02).sin().powi(40)).collect();
        assert!(found(&blunt).is_empty(), "peaks over some samples");
    }
}
