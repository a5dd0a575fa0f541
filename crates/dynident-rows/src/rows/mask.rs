//! Masks of the rows of prepared motions.

use super::JointRows;
use crate::recording::MotionRecord;
use dynident_recording::MotionBlock;

/// Drops invalid rows.
#[derive(Debug)]
pub struct RowMask<'a> {
    record: &'a MotionRecord,
    /// For each sample, the number of unusable samples before it.
    unusable_before: Vec<usize>,
    half: usize,
    factor: usize,
    done: Vec<usize>,
    places: Vec<usize>,
    kept: Vec<f64>,
    coverage: Vec<f64>,
}

impl<'a> RowMask<'a> {
    /// Mask for the rows of a record after a filter that uses `half` samples on each side and decimates by `factor`;
    /// `None` if all rows are valid.
    pub fn of(record: &'a MotionRecord, half: usize, factor: usize) -> Option<Self> {
        if record.usable.is_empty() && record.windows.is_none() {
            return None;
        }
        let samples = record.motion.rows;
        let mut unusable_before = Vec::with_capacity(samples + 1);
        unusable_before.push(0_usize);
        for sample in 0..samples {
            let spoilt = record.usable.get(sample).is_some_and(|usable| !usable);
            unusable_before.push(unusable_before[sample] + usize::from(spoilt));
        }
        let done = vec![0; record.motion.joints];
        Some(Self {
            record,
            unusable_before,
            half,
            factor,
            done,
            places: Vec::new(),
            kept: Vec::new(),
            coverage: Vec::new(),
        })
    }

    /// The valid rows among the next rows of a joint.
    pub fn apply<'s>(&'s mut self, all: &JointRows<'_>) -> JointRows<'s> {
        let Self { record, unusable_before, half, factor, done, places, kept, coverage } = self;
        let &JointRows { joint, rows, .. } = all;
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
        for column in all.panel.chunks_exact(rows) {
            kept.extend(places.iter().map(|&row| column[row]));
        }
        coverage.clear();
        coverage.extend(places.iter().filter_map(|&row| all.coverage.get(row)));
        JointRows { joint, rows: places.len(), panel: kept, coverage }
    }
}
