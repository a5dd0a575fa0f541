//! Placement of rows on the time axis, in steps of the even grid, and detection of the ends of pieces.

use super::drift::{CONTEXT_ROWS, smoothed};
use super::{Clock, Spacing};
use crate::log::RawBlock;

/// Maximum gap that is kept on the time axis, steps (eleven days at 1 kHz). A longer gap results from a wrong stamp;
/// places after it would lose precision.
const MAX_GAP_STEPS: f64 = 1e9;

/// Number of rows within which the stamps after a late packet must be on time again.
const MAX_LATE_ROWS: usize = 32;

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Places {
    /// Number of steps of the even grid since the first row of the log.
    pub(crate) steps: Vec<f64>,
    /// Whether a row starts a new piece: after a gap, or with an earlier stamp than the previous row.
    pub(crate) begins: Vec<bool>,
    /// Rows after a hole that is longer than a gap but can be filled.
    pub(crate) holes: Vec<usize>,
}

#[derive(Clone, Debug)]
pub(crate) struct Timeline {
    clock: Clock,
    longest_step_s: f64,
    longest_step_rows: f64,
    /// Maximum length of a hole that is filled, steps.
    bridged_steps: f64,
    /// For each of the last rows its number, its stamp (s) and whether it starts a piece.
    past: Vec<(u64, f64, bool)>,
    last: Option<(u64, f64, f64)>,
}

impl Timeline {
    /// Treats a step that is longer than `max_gap_steps` median steps as a gap, except holes of at most `bridged_steps`
    /// steps.
    pub(crate) fn new(clock: &Clock, max_gap_steps: f64, bridged_steps: f64) -> Self {
        Self {
            clock: clock.clone(),
            longest_step_s: max_gap_steps * clock.median_step_s,
            longest_step_rows: max_gap_steps,
            bridged_steps,
            past: Vec::new(),
            last: None,
        }
    }

    pub(crate) fn places(&mut self, block: &RawBlock, next: Option<&RawBlock>) -> Places {
        let (rate, n) = (self.clock.rate_hz, block.rows());
        let mut places = Places { steps: Vec::with_capacity(n), begins: vec![false; n], holes: Vec::new() };
        let mut before = self.last;
        for (index, (&row, &time_s)) in block.row.iter().zip(&block.time_s).enumerate() {
            let step = match before {
                Some((last_row, last_s, last_place)) => {
                    let (rows, time) = ((row - last_row) as f64, time_s - last_s);
                    let hole = f64::max(rows, time * rate);
                    let is_gap = rows > self.longest_step_rows
                        || time > self.longest_step_s && !self.catches_up(last_row, last_s, block, index, next);
                    if time < 0.0 || (is_gap && hole > self.bridged_steps) {
                        places.begins[index] = true;
                    } else if is_gap {
                        places.holes.push(index);
                    }
                    let even = match (is_gap && hole < MAX_GAP_STEPS, self.clock.repeats_rows && time == 0.0) {
                        // A copy of the previous row has the same place and is omitted.
                        (_, true) => 0.0,
                        (true, false) => hole.round().max(rows),
                        (false, false) => rows,
                    };
                    last_place + even
                }
                None => row as f64,
            };
            places.steps.push(if self.clock.spacing() == Spacing::Even { step } else { time_s * rate });
            before = Some((row, time_s, step));
        }
        if self.clock.spacing() == Spacing::Smoothed {
            self.smooth(block, next, &mut places);
        }
        self.last = before;
        places
    }

    /// Whether a late stamp is caused by a late packet and not by a gap: later stamps are on time again within
    /// `MAX_LATE_ROWS` rows.
    fn catches_up(&self, last_row: u64, last_s: f64, block: &RawBlock, index: usize, next: Option<&RawBlock>) -> bool {
        let late = (block.time_s[index] - last_s) * self.clock.rate_hz;
        // Repeated rows arrive at twice the rate and would compensate for any gap.
        if self.clock.spacing() == Spacing::Stamps || self.clock.repeats_rows || late > MAX_LATE_ROWS as f64 {
            return false;
        }
        let own = block.row[index..].iter().zip(&block.time_s[index..]);
        let further = next.into_iter().flat_map(|next| next.row.iter().zip(&next.time_s));
        own.chain(further).skip(1).take(MAX_LATE_ROWS).any(|(&row, &time_s)| {
            let late = (time_s - last_s) * self.clock.rate_hz - (row - last_row) as f64;
            time_s >= last_s && late < 1.0
        })
    }

    fn smooth(&mut self, block: &RawBlock, next: Option<&RawBlock>, places: &mut Places) {
        let rate = self.clock.rate_hz;
        let own = block.row.iter().zip(&block.time_s).zip(&places.begins);
        let own: Vec<(u64, f64, bool)> = own.map(|((row, time_s), begins)| (*row, *time_s, *begins)).collect();
        let mut rows = self.past.clone();
        rows.extend_from_slice(&own);
        if let Some(next) = next {
            let mut last = own.last().map(|(row, time_s, _)| (*row, *time_s));
            for (&row, &time_s) in next.row.iter().zip(&next.time_s).take(CONTEXT_ROWS) {
                let begins = last.is_some_and(|(last_row, last_s)| {
                    let hole = f64::max((row - last_row) as f64, (time_s - last_s) * rate);
                    time_s < last_s || hole > f64::max(self.bridged_steps, self.longest_step_s * rate)
                });
                rows.push((row, time_s, begins));
                last = Some((row, time_s));
            }
        }
        let numbers: Vec<f64> = rows.iter().map(|(row, ..)| *row as f64).collect();
        let stamps: Vec<f64> = rows.iter().map(|(_, time_s, _)| time_s * rate).collect();
        let begins: Vec<bool> = rows.iter().map(|(.., begins)| *begins).collect();
        let smooth = smoothed(&numbers, &stamps, &begins, self.clock.smoothing_rows / 2);
        places.steps.copy_from_slice(&smooth[self.past.len()..self.past.len() + own.len()]);
        self.past.extend(own);
        let unneeded = self.past.len().saturating_sub(CONTEXT_ROWS);
        self.past.drain(..unneeded);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{ClockSettings, clock};
    use crate::log::ClockRule;

    /// A hole of ten samples in a log with repeated rows is a gap; the repeated rows after it are not a late packet.
    #[test]
    fn repeated_rows_do_not_hide_a_gap() {
        let sample = |row: usize| row / 2 + if row < 400 { 0 } else { 10 };
        let time_s: Vec<f64> = (0..800).map(|row| sample(row) as f64 * 0.008).collect();
        let row: Vec<u64> = (0..800).collect();
        let q: Vec<f64> = time_s.iter().map(|t| (3.0 * t).sin()).collect();
        let clock = clock(ClockRule::Auto, &time_s, &row, &[q], 5.0, &ClockSettings::default()).unwrap();
        assert!(clock.repeats_rows, "{clock:?}");
        let block = RawBlock { row, time_s, ..RawBlock::default() };
        let places = Timeline::new(&clock, 5.0, 0.0).places(&block, None);
        let begins: Vec<usize> = (0..800).filter(|row| places.begins[*row]).collect();
        assert_eq!(begins, [400]);
        assert!((places.steps[799] - sample(799) as f64).abs() < 1e-6, "{}", places.steps[799]);
    }
}
