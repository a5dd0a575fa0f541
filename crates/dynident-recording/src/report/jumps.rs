//! Detection of samples that no motion can cause: angles that wrap around after a turn, single values far from their
//! neighbours, and jumps.

use super::settings::ReportSettings;
use serde::{Deserialize, Serialize};

/// Maximum difference of a wrapped step from a whole turn, as a share of the turn; it allows for the motion during one
/// sample.
const TURN_TOLERANCE: f64 = 0.1;
/// Factor per sample by which the influence of the largest step nearby decreases; it is negligible after some hundred
/// samples.
const DECAY: f64 = 0.99;
/// Number of steps before the detection starts.
const MIN_SAMPLES: u64 = 20;
/// Number of largest steps that are stored. If all of them were jumps, they would belong to the signal.
const KEPT_STEPS: usize = 8;

pub(super) const BATCH: usize = 64;
/// Lower bound on `DECAY` to the power of `BATCH`: the minimum influence of the largest step nearby at the end of a
/// batch.
const MIN_DECAY_PER_BATCH: f64 = 0.5;

/// A sample that is far from both of its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LoneSample {
    /// Index of the sample among the rows used, from 0.
    pub row: u64,
    /// Value (SI).
    pub value: f64,
    /// Previous value (SI).
    pub before: f64,
}

/// A change that no motion can cause and after which the channel does not return.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Jump {
    /// Index among the rows used (from 0) of the sample after the jump.
    pub row: u64,
    /// Value before the jump (SI).
    pub before: f64,
    /// Value after the jump (SI).
    pub after: f64,
    /// Largest difference between successive samples that is not a jump (SI).
    pub largest_other: f64,
    /// Period after which the channel wraps around, accurate to one step (SI), if every jump leads from one end of its
    /// range to the other; otherwise null.
    #[serde(default)]
    pub period: Option<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct JumpCheck {
    limits: ReportSettings,
    turn: Option<f64>,
    samples: u64,
    /// Number of samples since the last gap of the time stamps.
    since_gap: u64,
    last: [f64; 2],
    nearby: f64,
    low: f64,
    high: f64,
    wraps: u64,
    alone: u64,
    worst: Option<LoneSample>,
    worst_by: f64,
    /// The largest steps, the largest first: size, row after the step, and values before and after it.
    largest: Vec<(f64, u64, [f64; 2])>,
}

impl JumpCheck {
    /// Creates the check for a channel whose angles may wrap around at `turn`.
    pub(super) fn new(turn: Option<f64>, limits: ReportSettings) -> Self {
        Self {
            limits,
            turn,
            samples: 0,
            since_gap: 0,
            last: [0.0; 2],
            nearby: 0.0,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            wraps: 0,
            alone: 0,
            worst: None,
            worst_by: 0.0,
            largest: Vec::new(),
        }
    }

    /// Marks a gap of the time stamps before the next sample; the change over the gap is not a jump.
    pub(super) fn begin_piece(&mut self) {
        self.since_gap = 0;
    }

    /// Adds the next samples, at most [`BATCH`], with the same result as [`add`](Self::add) for each.
    pub(super) fn add_all(&mut self, values: &[f64]) {
        let [before, middle] = self.last;
        let [first, .., next_to_last, last] = *values else { return values.iter().for_each(|value| self.add(*value)) };
        let step = |pair: &[f64]| (pair[1] - pair[0]).abs();
        let larger = |a: f64, b: f64| if b > a { b } else { a };
        let begun = [(middle - before).abs(), (first - middle).abs()];
        let largest = values.windows(2).map(step).fold(larger(begun[0], begun[1]), larger);
        // Fast path: no sample is isolated or wraps around, and no step is one of the largest.
        let is_usual = self.since_gap >= 2
            && largest < self.limits.isolated_step_ratio * MIN_DECAY_PER_BATCH * self.nearby
            && self.turn.is_none_or(|turn| largest < 0.5 * turn)
            && self.largest.len() == KEPT_STEPS
            && self.largest[KEPT_STEPS - 1].0 >= largest;
        if !is_usual {
            return values.iter().for_each(|value| self.add(*value));
        }
        let passed = &values[..values.len() - 1];
        let steps = begun.into_iter().chain(passed.windows(2).map(step));
        self.nearby = steps.fold(self.nearby, |nearby, step| larger(DECAY * nearby, step));
        self.low = passed.iter().fold(self.low.min(middle), |low, value| if *value < low { *value } else { low });
        self.high = passed.iter().fold(self.high.max(middle), |high, value| larger(high, *value));
        self.last = [next_to_last, last];
        self.samples += values.len() as u64;
        self.since_gap += values.len() as u64;
    }

    #[inline]
    pub(super) fn add(&mut self, value: f64) {
        let [before, middle] = self.last;
        if self.since_gap >= 2 {
            let (to, from) = (middle - before, value - middle);
            let least = to.abs().min(from.abs());
            // Only the next sample shows whether the previous one was isolated.
            if to * from < 0.0
                && least > self.limits.isolated_step_ratio * self.nearby
                && self.samples > MIN_SAMPLES
                && self.nearby > 0.0
            {
                self.alone += 1;
                if least > self.worst_by {
                    self.worst_by = least;
                    self.worst = Some(LoneSample { row: self.samples - 1, value: middle, before });
                }
                // The isolated sample is not used for later comparisons.
                self.last = [before, value];
                self.samples += 1;
                self.since_gap += 1;
                return;
            }
            if let Some(turn) = self.turn
                && (to.abs() - turn).abs() < TURN_TOLERANCE * turn
                && self.nearby < 0.25 * turn
            {
                self.wraps += 1;
            } else {
                self.nearby = (DECAY * self.nearby).max(to.abs());
                self.keep(to.abs(), [before, middle]);
            }
            self.low = self.low.min(middle);
            self.high = self.high.max(middle);
        }
        self.last = [middle, value];
        self.samples += 1;
        self.since_gap += 1;
    }

    #[inline]
    fn keep(&mut self, size: f64, values: [f64; 2]) {
        if self.largest.len() == KEPT_STEPS && self.largest[KEPT_STEPS - 1].0 >= size {
            return;
        }
        let place = self.largest.partition_point(|kept| kept.0 >= size);
        self.largest.insert(place, (size, self.samples - 1, values));
        self.largest.truncate(KEPT_STEPS);
    }

    /// Number of steps far larger than all others, and the largest of them.
    pub(super) fn jumps(&self) -> (u64, Option<Jump>) {
        let range = self.high - self.low;
        let is_apart = |pair: &[(f64, u64, [f64; 2])]| {
            let [larger, smaller] = [pair[0].0, pair[1].0];
            smaller > 0.0
                && larger > self.limits.jump_step_ratio * smaller
                && larger > self.limits.jump_range_share * range
        };
        let apart = self.largest.windows(2).rposition(is_apart).filter(|_| self.largest.len() == KEPT_STEPS);
        let Some(last) = apart else { return (0, None) };
        let (_, row, [before, after]) = self.largest[0];
        let largest_other = self.largest[last + 1].0;
        // A counter that overflows jumps from one end of its range to the other.
        let is_whole_range = |kept: &(f64, u64, [f64; 2])| kept.0 >= range - 2.0 * largest_other;
        let period = self.largest[..=last].iter().all(is_whole_range).then_some(range);
        (last as u64 + 1, Some(Jump { row, before, after, largest_other, period }))
    }

    pub(super) fn wraps(&self) -> u64 {
        self.wraps
    }

    /// Number of isolated samples, and the worst of them if it deviates far enough.
    pub(super) fn lone(&self) -> (u64, Option<LoneSample>) {
        let range = self.high - self.low;
        match self.worst {
            Some(worst) if self.worst_by > self.limits.isolated_range_share * range => (self.alone, Some(worst)),
            _ => (0, None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_for(turn: Option<f64>) -> JumpCheck {
        JumpCheck::new(turn, ReportSettings::default())
    }

    fn seen(turn: Option<f64>, values: impl IntoIterator<Item = f64>) -> JumpCheck {
        let mut check = check_for(turn);
        values.into_iter().for_each(|value| check.add(value));
        check
    }

    fn noise(i: usize) -> f64 {
        (i as f64 * 0.754_877_666).fract() - 0.5
    }

    #[test]
    fn one_absurd_sample_is_found_and_noise_and_steps_are_not() {
        let clean = |i: usize| 20.0 * (i as f64 * 0.01).sin() + noise(i) + if i > 700 { 9.0 } else { 0.0 };
        assert_eq!(seen(None, (0..2000).map(clean)).lone(), (0, None));
        let one = seen(None, (0..2000).map(|i| if i == 1234 { 1e9 } else { clean(i) }));
        let (count, worst) = one.lone();
        assert_eq!((count, worst.map(|worst| (worst.row, worst.value))), (1, Some((1234, 1e9))));
    }

    #[test]
    fn a_lasting_step_is_a_jump_unless_it_is_over_a_gap() {
        let angle = |i: usize| 1.5 * (i as f64 * 0.01).sin() + 1e-4 * noise(i);
        assert_eq!(seen(None, (0..2000).map(angle)).jumps(), (0, None));
        // Two hundred missing rows.
        let cut = |i: usize| angle(if i < 700 { i } else { i + 200 });
        let (count, jump) = seen(None, (0..1500).map(cut)).jumps();
        let jump = jump.unwrap();
        assert_eq!((count, jump.row, jump.before, jump.after), (1, 700, angle(699), angle(900)));
        let mut paused = check_for(None);
        (0..700).for_each(|i| paused.add(angle(i)));
        paused.begin_piece();
        (900..2000).for_each(|i| paused.add(angle(i)));
        assert_eq!(paused.jumps(), (0, None));
        // An encoder that is stuck for a while.
        let frozen = |i: usize| angle(if (700..900).contains(&i) { 700 } else { i });
        assert_eq!(seen(None, (0..2000).map(frozen)).jumps().0, 1);
        assert_eq!(seen(None, (0..2000).map(frozen)).jumps().1.unwrap().period, None);
        // Repeated samples, encoder counts, rest.
        assert_eq!(seen(None, (0..2000).map(|i| angle(i / 6 * 6))).jumps().0, 0);
        assert_eq!(seen(None, (0..2000).map(|i| (angle(i) / 0.01).round() * 0.01)).jumps().0, 0);
        assert_eq!(seen(None, (0..2000).map(|i| angle(i.clamp(600, 1400)))).jumps().0, 0);
    }

    #[test]
    fn samples_added_together_equal_single_samples() {
        let pi = core::f64::consts::PI;
        let moving = |i: usize| 2.5 + 1.5 * (i as f64 * 0.01).sin() + 1e-4 * noise(i);
        let wrapped = |i: usize| if moving(i) > pi { moving(i) - 2.0 * pi } else { moving(i) };
        let spoilt = |i: usize| wrapped(i) + if i % 517 == 3 { 0.7 } else { 0.0 } + if i > 1500 { 0.2 } else { 0.0 };
        for turn in [None, Some(2.0 * pi)] {
            for run in [1, 2, 3, 7, BATCH] {
                let samples: Vec<f64> = (0..3000).map(spoilt).collect();
                let mut together = check_for(turn);
                samples.chunks(run).for_each(|run| together.add_all(run));
                assert_eq!(format!("{together:?}"), format!("{:?}", seen(turn, samples)), "{turn:?} {run}");
            }
        }
    }

    #[test]
    fn wrapped_angles_are_distinguished_from_fast_ones() {
        let angle = |i: usize| 2.5 + 1.5 * (i as f64 * 0.01).sin();
        let pi = core::f64::consts::PI;
        let wrapped = |i: usize| if angle(i) > pi { angle(i) - 2.0 * pi } else { angle(i) };
        assert_eq!(seen(Some(2.0 * pi), (0..2000).map(angle)).wraps(), 0);
        let check = seen(Some(2.0 * pi), (0..2000).map(wrapped));
        assert!(check.wraps() > 3 && check.lone().1.is_none(), "{check:?}");
    }

    #[test]
    fn a_counter_that_overflows_is_reported_with_its_period() {
        // Half a turn over sixteen bits.
        let period = core::f64::consts::PI;
        let counter = |i: usize| {
            let angle = 2.0 * (i as f64 * 0.003).sin();
            let wrapped = angle - period * (angle / period).round();
            (wrapped * 65536.0 / period).round() * period / 65536.0
        };
        let (count, jump) = seen(None, (0..2000).map(counter)).jumps();
        let found = jump.unwrap().period.unwrap();
        assert!(count > 1 && (found - period).abs() < 0.01, "{count} {found}");
    }

    #[test]
    fn flicker_of_the_last_digit_at_rest_is_not_isolated() {
        let check = seen(
            None,
            (0..2000)
                .map(|i| 5.0 * (f64::from(i) * 0.01).sin().clamp(-0.2, 0.2) + if i % 97 == 0 { 1e-3 } else { 0.0 }),
        );
        assert_eq!(check.lone(), (0, None));
    }
}
