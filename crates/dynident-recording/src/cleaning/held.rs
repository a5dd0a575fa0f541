//! Detection of torque that stays constant while its joint moves: a recorder repeated the value, or the value is
//! clipped at the end of the channel's range.

use super::CleaningSettings;
use super::outliers::median_size;
use crate::quantisation::{quantisation_step, usual_change};

/// Maximum number of samples on either side with which a run of equal values is compared.
pub(super) const MAX_WINDOW: usize = 512;

/// A run of equal values from sample `from` to sample `to` (exclusive).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) from: usize,
    pub(super) to: usize,
    /// Whether the value is an extreme of the channel (saturated); then the first sample of the run is invalid, too.
    pub(super) saturated: bool,
}

impl Run {
    /// The samples of the run that were not measured. The first sample of a held (not saturated) run was measured.
    pub(super) fn unmeasured(&self) -> core::ops::Range<usize> {
        self.from + usize::from(!self.saturated)..self.to
    }
}

/// Finds runs of equal torque values in `tau` during which the position `q` moves and which are longer than
/// quantisation explains. A run must have at least ten samples and be six times as long as the longest run nearby,
/// where the torque takes several values. A run at one of the `extremes` of the channel is saturated. For such a run,
/// other runs at an extreme do not count as runs nearby. (The peak of a smooth torque in quantisation steps is at most
/// `2 / (√2 − 1) = 4.8` times as long as the adjacent step.)
pub(super) fn held_runs(tau: &[f64], q: &[f64], extremes: [f64; 2], limits: &CleaningSettings) -> Vec<Run> {
    let shortest = limits.held_samples;
    let mut held = Vec::new();
    let n = tau.len();
    let mut from = 0;
    while from + shortest <= n {
        // For most samples, the value at the minimum run length already differs. Comparing it first is fast.
        if tau[from] != tau[from + shortest - 1] || tau[from..from + shortest].iter().any(|value| *value != tau[from]) {
            from += 1;
            continue;
        }
        let to = (from + shortest..n).find(|k| tau[*k] != tau[from]).unwrap_or(n);
        let run = Run { from, to, saturated: extremes.contains(&tau[from]) };
        if is_held(tau, q, run, extremes, limits) {
            held.push(run);
        }
        from = to;
    }
    held
}

fn is_held(tau: &[f64], q: &[f64], run: Run, extremes: [f64; 2], limits: &CleaningSettings) -> bool {
    let length = run.to - run.from;
    let around = length.clamp(5 * limits.held_samples, MAX_WINDOW);
    let sides = [run.from.saturating_sub(around)..run.from, run.to..(run.to + around).min(tau.len())];
    let mut changes = Vec::new();
    let (mut longest, mut values, mut samples, mut path) = (0, 0, 0, 0.0);
    for side in sides {
        let (tau, q) = (&tau[side.clone()], &q[side]);
        samples += tau.len();
        changes.extend(tau.windows(length.min(tau.len()).max(1)).map(|run| run[run.len() - 1] - run[0]));
        values += tau.windows(2).filter(|pair| pair[0] != pair[1]).count();
        path += q.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>();
        let mut current = 0;
        for k in 0..tau.len() {
            current = if k > 0 && tau[k] == tau[k - 1] { current + 1 } else { 1 };
            // Saturation repeats, so other runs at an extreme do not show the usual length of runs.
            if !run.saturated || !extremes.contains(&tau[k]) {
                longest = longest.max(current);
            }
        }
    }
    let step = quantisation_step(&tau[run.from.saturating_sub(around)..(run.to + around).min(tau.len())]);
    let changes_enough = step.is_none_or(|step| median_size(changes.into_iter()) > limits.held_steps * step);
    let moved = q[run.from..run.to].windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>();
    // For back-and-forth motion, the range of the positions is used, not the distance between the ends.
    let [low, high] = q[run.from..run.to]
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &q| [low.min(q), high.max(q)]);
    let net = high - low;
    let expected = path * length as f64 / samples.max(1) as f64;
    samples >= 2 * limits.held_samples
        && values >= limits.held_changes_nearby
        && changes_enough
        && length >= limits.held_run_ratio * longest
        && moved > limits.held_motion_share * expected
        && net > limits.held_motion_share * moved
        && quantisation_step(q).is_none_or(|step| net > limits.held_steps * step)
        && usual_change(&q[run.from..run.to]).is_none_or(|change| net > limits.held_steps * change)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::normal;

    fn held(tau: &[f64], q: &[f64], extremes: [f64; 2]) -> Vec<Run> {
        held_runs(tau, q, extremes, &CleaningSettings::default())
    }

    fn signals(n: usize) -> (Vec<f64>, Vec<f64>) {
        let noise = normal(11, n);
        let t = |i: usize| i as f64 * 0.001;
        let tau = (0..n).map(|i| 20.0 * (1.5 * t(i)).sin() + 0.05 * noise[i]).collect();
        let q = (0..n).map(|i| (1.5 * t(i)).cos()).collect();
        (tau, q)
    }

    #[test]
    fn a_held_torque_is_found_whether_or_not_it_is_quantised() {
        for step in [0.0, 0.01, 0.1] {
            let (mut tau, q) = signals(4000);
            if step > 0.0 {
                for tau in &mut tau {
                    *tau = (*tau / step).round() * step;
                }
            }
            assert!(held(&tau, &q, [-20.5, 20.5]).is_empty(), "{step}");
            let value = tau[1500];
            tau[1500..1700].fill(value);
            let found = held(&tau, &q, [-20.5, 20.5]);
            assert_eq!(found.len(), 1, "{step}: {found:?}");
            // Adjacent samples may happen to have the same value.
            assert!(found[0].from.abs_diff(1500) <= 2 && found[0].to.abs_diff(1700) <= 2, "{step}: {found:?}");
        }
    }

    /// At the end of the run the joint is back at the position of its start.
    #[test]
    fn a_torque_dropout_during_back_and_forth_motion_is_held() {
        let noise = normal(13, 6000);
        let t = |i: usize| i as f64 * 0.01;
        let mut tau: Vec<f64> = (0..6000).map(|i| 20.0 * (1.5 * t(i)).sin() + 0.05 * noise[i]).collect();
        let q: Vec<f64> = (0..6000).map(|i| (1.5 * t(i)).cos()).collect();
        tau[2000..2419].fill(0.0);
        let found = held(&tau, &q, [-20.5, 20.5]);
        assert_eq!(found, [Run { from: 2000, to: 2419, saturated: false }]);
    }

    #[test]
    fn rest_coarse_steps_and_slow_updates_are_not_held() {
        let (tau, q) = signals(4000);
        let coarse: Vec<f64> = tau.iter().map(|tau| (tau / 4.0).round() * 4.0).collect();
        assert!(held(&coarse, &q, [-20.0, 20.0]).is_empty());
        let slow: Vec<f64> = (0..4000).map(|i| tau[i / 8 * 8]).collect();
        assert!(held(&slow, &q, [-20.5, 20.5]).is_empty());
        let mut resting = (tau.clone(), q.clone());
        resting.0[1000..2000].fill(3.0);
        resting.1[1000..2000].fill(0.4);
        assert!(held(&resting.0, &resting.1, [-20.5, 20.5]).is_empty());
        // Occasional encoder counts at rest are not motion.
        resting.1[1000..2000].iter_mut().enumerate().for_each(|(i, q)| *q += 2e-6 * (i / 60) as f64);
        assert!(held(&resting.0[900..1100], &resting.1[900..1100], [-20.5, 20.5]).is_empty());
        // Peaks of a noise-free torque, quantised.
        for step in [0.05, 0.1, 0.37, 1.0] {
            let smooth = |i: usize| (20.0 * (1.5 * i as f64 * 0.001).sin() / step).round() * step;
            let stepped: Vec<f64> = (0..20_000).map(smooth).collect();
            let q: Vec<f64> = (0..20_000).map(|i| (1.5 * f64::from(i) * 0.001 + 0.7).cos()).collect();
            let extremes = [-1.0, 1.0].map(|sign| sign * stepped.iter().copied().fold(0.0, f64::max));
            assert!(held(&stepped, &q, extremes).is_empty(), "{step}");
        }
    }

    /// Also for limits that clip most samples.
    #[test]
    fn clipped_torque_is_saturated() {
        let noise = normal(12, 8000);
        let tau: Vec<f64> = (0..8000).map(|i| 20.0 * (6.0 * i as f64 * 0.001).sin() + 0.05 * noise[i]).collect();
        let q: Vec<f64> = (0..8000).map(|i| (6.0 * f64::from(i) * 0.001 + 0.7).cos()).collect();
        for limit in [19.0, 12.0, 4.0] {
            let clipped: Vec<f64> = tau.iter().map(|tau| tau.clamp(-limit, limit)).collect();
            let found = held(&clipped, &q, [-limit, limit]);
            assert!(found.iter().all(|run| run.saturated), "{limit}: {found:?}");
            let detected: usize = found.iter().map(|run| run.unmeasured().len()).sum();
            let cut = tau.iter().filter(|tau| tau.abs() > limit).count();
            // Runs shorter than ten samples, where noise crosses the limit, are not detected.
            assert!(detected as f64 > 0.9 * cut as f64 && detected <= cut, "{limit}: {detected} of {cut}");
        }
    }
}
