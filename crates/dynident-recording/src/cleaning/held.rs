//! Torque that stands still while its joint moves.

use super::outliers::middle;
use crate::quantisation::{quantisation_step, usual_change};

/// Shortest run of one value that is looked at, samples.
const SHORTEST: usize = 10;
/// Samples to either side that a run is held against, at most.
pub(super) const AROUND: usize = 512;
/// Times the longest run nearby that a held one has to last.
const TIMES_NEARBY: usize = 6;
/// Different values that the torque has to take nearby: a torque that hardly changes repeats by its quantisation.
const VALUES_NEARBY: usize = 6;
/// Least motion during the run as a share of the motion nearby in as many samples.
const SHARE_OF_MOTION: f64 = 0.1;
/// Least motion in steps of a quantised encoder, and least usual change of a quantised torque over as many samples.
const QUANTA: f64 = 4.0;

/// A run of one value; its first sample was measured, those from `from + 1` to `to` (exclusive) are repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) from: usize,
    pub(super) to: usize,
}

/// Runs of one and the same torque in `tau` while the position `q` moves on, longer than the quantisation explains: at
/// least ten samples, six times the longest run nearby, where the torque takes several values. A torque at `extremes`
/// of the channel is saturated, not held.
pub(super) fn held_runs(tau: &[f64], q: &[f64], extremes: [f64; 2]) -> Vec<Run> {
    let mut held = Vec::new();
    let n = tau.len();
    let mut from = 0;
    while from + SHORTEST <= n {
        // Most samples differ from the one at the run's least length, which is looked at first.
        if tau[from] != tau[from + SHORTEST - 1] || tau[from..from + SHORTEST].iter().any(|value| *value != tau[from]) {
            from += 1;
            continue;
        }
        let to = (from + SHORTEST..n).find(|k| tau[*k] != tau[from]).unwrap_or(n);
        let run = Run { from, to };
        if !extremes.contains(&tau[from]) && is_held(tau, q, run) {
            held.push(run);
        }
        from = to;
    }
    held
}

fn is_held(tau: &[f64], q: &[f64], run: Run) -> bool {
    let length = run.to - run.from;
    let around = length.clamp(5 * SHORTEST, AROUND);
    let sides = [run.from.saturating_sub(around)..run.from, run.to..(run.to + around).min(tau.len())];
    let mut changes = Vec::new();
    let (mut longest, mut values, mut samples, mut path) = (0, 0, 0, 0.0);
    for side in sides {
        let (tau, q) = (&tau[side.clone()], &q[side]);
        samples += tau.len();
        changes.extend(tau.windows(length.min(tau.len()).max(1)).map(|run| (run[run.len() - 1] - run[0]).abs()));
        values += tau.windows(2).filter(|pair| pair[0] != pair[1]).count();
        path += q.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>();
        let mut current = 0;
        for k in 0..tau.len() {
            current = if k > 0 && tau[k] == tau[k - 1] { current + 1 } else { 1 };
            longest = longest.max(current);
        }
    }
    let step = quantisation_step(&tau[run.from.saturating_sub(around)..(run.to + around).min(tau.len())]);
    let changes_enough = step.is_none_or(|step| middle(&mut changes) > QUANTA * step);
    let moved = q[run.from..run.to].windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum::<f64>();
    let net = (q[run.to - 1] - q[run.from]).abs();
    let expected = path * length as f64 / samples.max(1) as f64;
    samples >= 2 * SHORTEST
        && values >= VALUES_NEARBY
        && changes_enough
        && length >= TIMES_NEARBY * longest
        && moved > SHARE_OF_MOTION * expected
        && net > SHARE_OF_MOTION * moved
        && quantisation_step(q).is_none_or(|step| net > QUANTA * step)
        && usual_change(&q[run.from..run.to]).is_none_or(|change| net > QUANTA * change)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::derivative::test_signals::normal;

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
            assert!(held_runs(&tau, &q, [-20.5, 20.5]).is_empty(), "{step}");
            let value = tau[1500];
            tau[1500..1700].fill(value);
            let found = held_runs(&tau, &q, [-20.5, 20.5]);
            assert_eq!(found.len(), 1, "{step}: {found:?}");
            // The samples beside it may happen to have its value.
            assert!(found[0].from.abs_diff(1500) <= 2 && found[0].to.abs_diff(1700) <= 2, "{step}: {found:?}");
        }
    }

    #[test]
    fn rest_coarse_steps_slow_updates_and_saturation_are_not_held() {
        let (tau, q) = signals(4000);
        let coarse: Vec<f64> = tau.iter().map(|tau| (tau / 4.0).round() * 4.0).collect();
        assert!(held_runs(&coarse, &q, [-20.0, 20.0]).is_empty());
        let slow: Vec<f64> = (0..4000).map(|i| tau[i / 8 * 8]).collect();
        assert!(held_runs(&slow, &q, [-20.5, 20.5]).is_empty());
        let mut resting = (tau.clone(), q.clone());
        resting.0[1000..2000].fill(3.0);
        resting.1[1000..2000].fill(0.4);
        assert!(held_runs(&resting.0, &resting.1, [-20.5, 20.5]).is_empty());
        // A count of the encoder now and then is no motion.
        resting.1[1000..2000].iter_mut().enumerate().for_each(|(i, q)| *q += 2e-6 * (i / 60) as f64);
        assert!(held_runs(&resting.0[900..1100], &resting.1[900..1100], [-20.5, 20.5]).is_empty());
        let clipped: Vec<f64> = tau.iter().map(|tau| tau.clamp(-12.0, 12.0)).collect();
        assert!(held_runs(&clipped, &q, [-12.0, 12.0]).is_empty());
    }
}
