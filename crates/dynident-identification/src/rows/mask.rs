//! A motion that is made already, and which of its rows count.

use dynident_recording::{Log, MotionBlock};
use std::sync::Arc;

/// A motion that is made already, with its torques: joints in the model's order, one uninterrupted piece.
#[derive(Clone, Debug)]
pub struct MotionRecord {
    /// What messages call it.
    pub label: String,
    /// Positions, velocities, accelerations and torques.
    pub motion: Arc<MotionBlock>,
    /// Sample by sample whether it can be used at all; empty if all can. A filtered row sees none that cannot.
    pub usable: Vec<bool>,
    /// For each joint the times (from, to; s) at which its torque counts; `None` if it always does.
    pub windows: Option<Vec<Vec<[f64; 2]>>>,
    /// The raw samples that it was made from, for estimators that smooth or simulate anew; joints in the model's order.
    pub raw: Option<Log>,
}

impl MotionRecord {
    /// The same with every row, where only samples at the ends do not count.
    pub(crate) fn with_every_row(&self) -> Option<Self> {
        let first = self.usable.iter().position(|usable| *usable).unwrap_or(0);
        let last = self.usable.iter().rposition(|usable| *usable).unwrap_or(0);
        let inside = self.usable.get(first..=last).unwrap_or_default();
        let whole = self.windows.is_none() && inside.iter().all(|usable| *usable);
        whole.then(|| Self { usable: Vec::new(), ..self.clone() })
    }

    /// The mask of its rows behind a filter that reaches `half` samples to either side and keeps every `factor`-th row;
    /// `None` where all count.
    pub(crate) fn mask(&self, half: usize, factor: usize) -> Option<RowMask<'_>> {
        if self.usable.is_empty() && self.windows.is_none() {
            return None;
        }
        let samples = self.motion.rows;
        let mut unusable_before = Vec::with_capacity(samples + 1);
        unusable_before.push(0_usize);
        for sample in 0..samples {
            let spoilt = self.usable.get(sample).is_some_and(|usable| !usable);
            unusable_before.push(unusable_before[sample] + usize::from(spoilt));
        }
        let done = vec![0; self.motion.joints];
        Some(RowMask { record: self, unusable_before, half, factor, done, places: Vec::new(), kept: Vec::new() })
    }
}

/// Leaves out rows that do not count.
#[derive(Debug)]
pub(crate) struct RowMask<'a> {
    record: &'a MotionRecord,
    /// How many of the samples before each cannot be used.
    unusable_before: Vec<usize>,
    half: usize,
    factor: usize,
    /// Rows of each joint so far.
    done: Vec<usize>,
    places: Vec<usize>,
    kept: Vec<f64>,
}

impl RowMask<'_> {
    /// The rows that count of the next `rows` rows of a joint, as a panel of their own.
    pub(crate) fn apply(&mut self, joint: usize, rows: usize, panel: &[f64]) -> (usize, &[f64]) {
        let Self { record, unusable_before, half, factor, done, places, kept } = self;
        let MotionBlock { rows: samples, first_time_s, rate_hz, .. } = *record.motion;
        let first = done[joint];
        done[joint] += rows;
        let counts = |row: &usize| {
            let centre = (first + row) * *factor + *half;
            let clean = unusable_before[centre - *half] == unusable_before[(centre + *half + 1).min(samples)];
            let time_s = first_time_s + centre as f64 / rate_hz;
            let inside =
                |windows: &Vec<Vec<[f64; 2]>>| windows[joint].iter().any(|[from, to]| (*from..=*to).contains(&time_s));
            clean && record.windows.as_ref().is_none_or(inside)
        };
        places.clear();
        places.extend((0..rows).filter(counts));
        kept.clear();
        for column in panel.chunks_exact(rows) {
            kept.extend(places.iter().map(|&row| column[row]));
        }
        (places.len(), kept)
    }
}
