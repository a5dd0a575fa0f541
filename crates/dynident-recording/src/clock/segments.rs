//! Division of a log into uninterrupted pieces, each on a separate uniform grid.

use super::resampler::Resampler;

/// Divides a stream of rows at the start of each piece and interpolates each piece to its grid.
#[derive(Clone, Debug)]
pub(crate) struct Segmenter {
    resampler: Resampler,
    last: bool,
    first: Option<(f64, f64)>,
    closed: bool,
    crowded: u64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedRows<'a> {
    /// Time stamps, s.
    pub(crate) time_s: &'a [f64],
    /// Places of the rows on the time axis, in steps.
    pub(crate) steps: &'a [f64],
    /// Whether a row starts a new piece.
    pub(crate) begins: &'a [bool],
}

impl Segmenter {
    pub(crate) fn new(channels: usize) -> Self {
        Self { resampler: Resampler::new(channels), last: false, first: None, closed: false, crowded: 0 }
    }

    /// Whether the piece in `out` is complete and waits for [`reopen`](Self::reopen).
    pub(crate) fn closed(&self) -> bool {
        self.closed
    }

    pub(crate) fn first_time_s(&self) -> f64 {
        self.first.map_or(0.0, |(_, time_s)| time_s)
    }

    /// Place of a row relative to the first sample of its piece, in steps.
    pub(crate) fn place_in_piece(&self, steps: f64) -> f64 {
        self.first.map_or(0.0, |(first, _)| steps - first)
    }

    /// Number of samples that were omitted because they are too close to the previous one.
    pub(crate) fn crowded(&self) -> u64 {
        self.crowded
    }

    /// Takes rows from `at` on until the rows or the piece end, and returns the row at which it stopped. `columns`
    /// returns the channels.
    pub(crate) fn feed<'a, I: Iterator<Item = &'a Vec<f64>>>(
        &mut self,
        rows: PlacedRows<'_>,
        at: usize,
        out: &mut [Vec<f64>],
        columns: impl Fn() -> I,
    ) -> usize {
        let mut index = at;
        while index < rows.steps.len() {
            if self.last && rows.begins[index] {
                self.close(out);
                return index;
            }
            let (first, _) = *self.first.get_or_insert((rows.steps[index], rows.time_s[index]));
            let follow = rows.begins[index + 1..].iter().take_while(|begins| !**begins).count();
            let steps = &rows.steps[index..=index + follow];
            let added = self.resampler.push(steps.iter().map(|step| step - first), index, columns());
            // The sample at which `push` stopped is too close to the previous one.
            self.crowded += u64::from(added < steps.len());
            index += (added + 1).min(steps.len());
            self.last = true;
        }
        self.resampler.drain(false, out);
        rows.steps.len()
    }

    pub(crate) fn close(&mut self, out: &mut [Vec<f64>]) {
        if !self.closed {
            self.resampler.drain(true, out);
            self.closed = true;
        }
    }

    pub(crate) fn reopen(&mut self) {
        self.closed = false;
        self.first = None;
        self.last = false;
    }
}
