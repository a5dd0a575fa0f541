//! Division of a motion into strokes from rest to rest.

use serde::{Deserialize, Serialize};

/// A part of a joint's motion from rest to rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stroke {
    /// Start of the samples that belong to the stroke, s: the middle of the rest before it.
    pub owns_from_s: f64,
    /// End of the samples that belong to the stroke, s: the middle of the rest after it.
    pub owns_to_s: f64,
    /// Start of the motion, s.
    pub from_s: f64,
    /// End of the motion, s.
    pub to_s: f64,
    /// Whether the motion is monotone, so that the position determines the velocity.
    pub monotone: bool,
}

impl Stroke {
    pub(crate) fn later_by(self, seconds: f64) -> Self {
        Self {
            owns_from_s: self.owns_from_s + seconds,
            owns_to_s: self.owns_to_s + seconds,
            from_s: self.from_s + seconds,
            to_s: self.to_s + seconds,
            monotone: self.monotone,
        }
    }
}

/// The strokes of a sampled motion (q, dq, ddq), separated by rests of at least two samples.
pub(crate) fn strokes_of(times_s: &[f64], values: &[[f64; 3]], resting: &[bool]) -> Vec<Stroke> {
    let n = times_s.len();
    // A single sample at rest is a reversal, not a rest.
    let rest = |i: usize| resting[i] && (i == 0 || resting[i - 1] || (i + 1 < n && resting[i + 1]));
    let mut moving: Vec<[usize; 2]> = Vec::new();
    for i in (0..n).filter(|&i| !rest(i)) {
        match moving.last_mut() {
            Some([_, to]) if *to + 1 == i => *to = i,
            _ => moving.push([i, i]),
        }
    }
    let mut strokes: Vec<Stroke> = moving
        .iter()
        .map(|&[first, last]| {
            // From the last sample at rest to the next one at rest.
            let (from, to) = (first.saturating_sub(1), (last + 1).min(n - 1));
            let sign = values[first..=last].iter().map(|value| value[1]).sum::<f64>().signum();
            let monotone = values[first..=last].iter().all(|value| value[1] * sign > 0.0);
            Stroke {
                owns_from_s: f64::NEG_INFINITY,
                owns_to_s: f64::INFINITY,
                from_s: times_s[from],
                to_s: times_s[to],
                monotone,
            }
        })
        .collect();
    share_rests(&mut strokes);
    strokes
}

/// Number of samples of a stroke at which reversals are tested.
const TESTED_SAMPLES: u32 = 500;

/// The stroke between two given times. `motion` returns the velocity at a time, and whether the joint rests.
pub(crate) fn between(from_s: f64, to_s: f64, motion: impl Fn(f64) -> (f64, bool)) -> Stroke {
    let samples = (0..TESTED_SAMPLES)
        .map(|k| motion(from_s + (to_s - from_s) * (f64::from(k) + 0.5) / f64::from(TESTED_SAMPLES)));
    let velocities: Vec<f64> = samples.filter(|(_, rests)| !rests).map(|(speed, _)| speed).collect();
    let sign = velocities.iter().sum::<f64>().signum();
    let monotone = velocities.iter().all(|speed| speed * sign > 0.0);
    Stroke { owns_from_s: f64::NEG_INFINITY, owns_to_s: f64::INFINITY, from_s, to_s, monotone }
}

/// Divides the rests between strokes at their middles.
pub(crate) fn share_rests(strokes: &mut [Stroke]) {
    for i in 1..strokes.len() {
        let middle = 0.5 * (strokes[i - 1].to_s + strokes[i].from_s);
        (strokes[i - 1].owns_to_s, strokes[i].owns_from_s) = (middle, middle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rests_separate_strokes_and_reversals_do_not() {
        let times: Vec<f64> = (0..10).map(f64::from).collect();
        // Rest, forward, rest, forward and back with a turn, rest.
        let velocities = [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
        let values = velocities.map(|dq| [0.0, dq, 0.0]);
        let strokes = strokes_of(&times, &values, &velocities.map(|dq| dq == 0.0));
        assert_eq!(strokes.len(), 2);
        assert_eq!((strokes[0].from_s, strokes[0].to_s, strokes[0].monotone), (0.0, 3.0, true));
        assert_eq!((strokes[1].from_s, strokes[1].to_s, strokes[1].monotone), (4.0, 8.0, false));
        assert_eq!((strokes[0].owns_to_s, strokes[1].owns_from_s), (3.5, 3.5));
        assert!(strokes_of(&times, &values, &[true; 10]).is_empty());
        let all = strokes_of(&times, &values, &[false; 10]);
        assert_eq!((all.len(), all[0].from_s, all[0].to_s), (1, 0.0, 9.0));
    }
}
