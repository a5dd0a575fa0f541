//! Statistics of time steps, gaps and stamps out of order, accumulated row by row.

use super::{Gap, Steps};

const MAX_LISTED_GAPS: usize = 100;

#[derive(Clone, Debug, Default)]
pub(crate) struct TimeCheck {
    median_s: f64,
    last: Option<(u64, f64)>,
    count: f64,
    mean: f64,
    square: f64,
    min: f64,
    max: f64,
    pub(crate) gap_count: u64,
    pub(crate) gaps: Vec<Gap>,
    pub(crate) duplicates: u64,
    pub(crate) backward: u64,
}

impl TimeCheck {
    pub(crate) fn new(median_s: f64) -> Self {
        Self { median_s, min: f64::INFINITY, max: f64::NEG_INFINITY, ..Self::default() }
    }

    /// Adds the next row; returns whether there is a gap before it.
    pub(crate) fn add(&mut self, row: u64, time_s: f64) -> bool {
        let mut is_gap = false;
        if let Some((before, last_s)) = self.last {
            let step = time_s - last_s;
            self.duplicates += u64::from(step == 0.0);
            self.backward += u64::from(step < 0.0);
            is_gap = step > 3.0 * self.median_s;
            if is_gap {
                self.gap_count += 1;
                if self.gaps.len() < MAX_LISTED_GAPS {
                    self.gaps.push(Gap { row: before, time_s: last_s, length_s: step });
                }
            }
            self.min = self.min.min(step);
            self.max = self.max.max(step);
            // Welford's recursion is accurate for nearly constant steps.
            self.count += 1.0;
            let difference = step - self.mean;
            self.mean += difference / self.count;
            self.square += difference * (step - self.mean);
        }
        self.last = Some((row, time_s));
        is_gap
    }

    pub(crate) fn steps(&self) -> Steps {
        if self.count == 0.0 {
            return Steps::default();
        }
        Steps {
            min_s: self.min,
            median_s: self.median_s,
            max_s: self.max,
            std_s: (self.square / self.count).max(0.0).sqrt(),
        }
    }
}
