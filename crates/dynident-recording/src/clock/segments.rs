//! Uninterrupted pieces of a log, each on its own uniform grid.

use super::Clock;
use super::resampler::Resampler;

/// Cuts a stream of rows at gaps and backward stamps and resamples each piece.
#[derive(Clone, Debug)]
pub(crate) struct Segmenter {
    uniform: bool,
    rate_hz: f64,
    longest_step_s: f64,
    longest_step_rows: f64,
    resampler: Resampler,
    last: Option<(u64, f64)>,
    first: Option<(u64, f64)>,
    closed: bool,
    crowded: u64,
}

impl Segmenter {
    pub(crate) fn new(clock: &Clock, max_gap_steps: f64, channels: usize) -> Self {
        Self {
            uniform: clock.uniform,
            rate_hz: clock.rate_hz,
            longest_step_s: max_gap_steps * clock.median_step_s,
            longest_step_rows: max_gap_steps,
            resampler: Resampler::new(channels),
            last: None,
            first: None,
            closed: false,
            crowded: 0,
        }
    }

    /// Whether the piece in `out` is complete and waits for [`reopen`](Self::reopen).
    pub(crate) fn closed(&self) -> bool {
        self.closed
    }

    /// Time of the piece's first sample.
    pub(crate) fn first_time_s(&self) -> f64 {
        self.first.map_or(0.0, |(_, time_s)| time_s)
    }

    /// Samples left out for standing too close to the one before.
    pub(crate) fn crowded(&self) -> u64 {
        self.crowded
    }

    /// Takes rows from `at` on until they end or the piece does; returns the row where it stopped. `columns` gives the
    /// channels.
    pub(crate) fn feed<'a, I: Iterator<Item = &'a Vec<f64>>>(
        &mut self,
        row: &[u64],
        time_s: &[f64],
        at: usize,
        out: &mut [Vec<f64>],
        columns: impl Fn() -> I,
    ) -> usize {
        for index in at..row.len() {
            let (row, time_s) = (row[index], time_s[index]);
            if let Some((last_row, last_s)) = self.last {
                let step = time_s - last_s;
                let rows = (row - last_row) as f64;
                // A dropped row is no gap in time beyond its own length, but too many of them are.
                if step < 0.0 || step > self.longest_step_s || rows > self.longest_step_rows {
                    self.close(out);
                    return index;
                }
            }
            let (first_row, first_s) = *self.first.get_or_insert((row, time_s));
            let stamp = if self.uniform { (row - first_row) as f64 } else { (time_s - first_s) * self.rate_hz };
            self.crowded += u64::from(!self.resampler.push(stamp, index, columns()));
            self.last = Some((row, time_s));
        }
        self.resampler.drain(false, out);
        row.len()
    }

    /// Ends the piece: appends what is left of it to `out`.
    pub(crate) fn close(&mut self, out: &mut [Vec<f64>]) {
        if !self.closed {
            self.resampler.drain(true, out);
            self.closed = true;
        }
    }

    /// Starts the next piece.
    pub(crate) fn reopen(&mut self) {
        self.closed = false;
        self.first = None;
        self.last = None;
    }
}
