//! Extremes of every limit along a motion, also between samples.

use super::set::{LimitSet, LimitWorkspace};
use crate::motion::Motion;

/// Largest value of one row of constraints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Index of the row in the set.
    pub row: usize,
    /// Largest value; infinite if the motion is not finite.
    pub value: f64,
    /// Largest value among the samples.
    pub sampled: f64,
    /// Time of the largest value, s.
    pub at_s: f64,
}

/// Settings of [`peaks()`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeakSettings {
    /// A sampled maximum of a row is refined if it is at most this far below the largest sample of the row.
    /// Constraint values are relative to their limits. Default 0.1.
    pub band: f64,
    /// Number of golden-section steps; each reduces the bracket by a factor of 0.618.
    pub steps: usize,
}

impl Default for PeakSettings {
    /// Band 0.1 and 32 steps, which reduce a bracket of two sampling intervals to 4e-7 of one.
    fn default() -> Self {
        Self { band: 0.1, steps: 32 }
    }
}

struct Bracket {
    row: usize,
    from: f64,
    to: f64,
    inner: [(f64, f64); 2],
    best: (f64, f64),
}

const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Finds the largest value of every row between the first and the last of `times_s` (ascending). Every sampled
/// maximum close to the row's largest value is refined by golden section. `motion` writes the exact motion at any
/// list of times, like [`Family::motion`](crate::Family::motion).
///
/// Finds every extreme that is a local maximum of the samples; at a discontinuity (of jerk) the side with the larger
/// samples. All brackets advance together, so the cost is `steps` blocks with one sample per maximum.
pub fn peaks(
    set: &LimitSet,
    workspace: &mut LimitWorkspace,
    times_s: &[f64],
    settings: PeakSettings,
    mut motion: impl FnMut(&[f64], &mut Motion),
) -> Vec<Peak> {
    peaks_of(set, workspace, times_s, settings, &mut motion)
}

/// [`peaks()`], compiled once for all motions.
fn peaks_of(
    set: &LimitSet,
    workspace: &mut LimitWorkspace,
    times_s: &[f64],
    settings: PeakSettings,
    motion: &mut dyn FnMut(&[f64], &mut Motion),
) -> Vec<Peak> {
    let (mut block, mut values) = (Motion::default(), Vec::new());
    motion(times_s, &mut block);
    set.values(workspace, &block, &mut values);
    let samples = times_s.len();
    if samples == 0 {
        return Vec::new();
    }
    let (mut found, mut brackets) = (Vec::new(), Vec::new());
    for (row, values) in values.chunks_exact(samples).enumerate() {
        let peak = sampled_peak(row, values, times_s);
        bracket_maxima(&peak, values, times_s, settings.band, &mut brackets);
        found.push(peak);
    }
    let mut times = Vec::with_capacity(brackets.len() * 2);
    for step in 0..settings.steps {
        // The first step evaluates both inner points of a bracket, later steps only the new one.
        times.clear();
        for bracket in &brackets {
            times.extend(bracket.inner.iter().filter(|(_, value)| value.is_nan()).map(|(at, _)| *at));
        }
        if times.is_empty() {
            break;
        }
        motion(&times, &mut block);
        set.values(workspace, &block, &mut values);
        let mut next = 0;
        for bracket in &mut brackets {
            for (at, value) in &mut bracket.inner {
                if value.is_nan() {
                    let sampled = values[bracket.row * times.len() + next];
                    next += 1;
                    *value = if sampled.is_nan() { f64::INFINITY } else { sampled };
                    if *value > bracket.best.0 {
                        bracket.best = (*value, *at);
                    }
                }
            }
            if step + 1 < settings.steps {
                bracket.narrow();
            }
        }
    }
    for bracket in &brackets {
        let peak = &mut found[bracket.row];
        if bracket.best.0 > peak.value {
            (peak.value, peak.at_s) = bracket.best;
        }
    }
    found
}

fn sampled_peak(row: usize, values: &[f64], times_s: &[f64]) -> Peak {
    let mut peak = Peak { row, value: f64::NEG_INFINITY, sampled: f64::NEG_INFINITY, at_s: times_s[0] };
    for (&value, &at_s) in values.iter().zip(times_s) {
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if value > peak.value {
            peak = Peak { value, sampled: value, at_s, ..peak };
        }
    }
    peak
}

/// Adds a bracket around every sampled maximum of a row that is at most `band` below the row's largest sample.
fn bracket_maxima(peak: &Peak, values: &[f64], times_s: &[f64], band: f64, brackets: &mut Vec<Bracket>) {
    let worth = peak.value - band;
    for (sample, &value) in values.iter().enumerate() {
        let before = sample.saturating_sub(1);
        let after = (sample + 1).min(values.len() - 1);
        let stands_out = value > values[before] || value > values[after];
        if value.is_finite() && stands_out && value >= worth && value >= values[before] && value >= values[after] {
            let (from, to) = (times_s[before], times_s[after]);
            let inner = [(to - GOLDEN * (to - from), f64::NAN), (from + GOLDEN * (to - from), f64::NAN)];
            brackets.push(Bracket { row: peak.row, from, to, inner, best: (value, times_s[sample]) });
        }
    }
}

impl Bracket {
    /// Removes the outer part of a bracket next to the inner point with the lower value.
    fn narrow(&mut self) {
        let [left, right] = self.inner;
        if left.1 >= right.1 {
            self.to = right.0;
            self.inner = [(self.to - GOLDEN * (self.to - self.from), f64::NAN), left];
        } else {
            self.from = left.0;
            self.inner = [right, (self.from + GOLDEN * (self.to - self.from), f64::NAN)];
        }
    }
}
