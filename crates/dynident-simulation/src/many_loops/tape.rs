//! Blocks of samples between loops that go from sample to sample side by side and arrays that are joint-major, loop by
//! loop.

use crate::reference::Reference;
use dynident_lanes::{AlignedBuffer, Lane};

/// Samples in a block: with 21 numbers of eight loops each, 21 kilobytes.
pub(super) const BLOCK: usize = 16;

/// Rows of numbers, each for all lanes: row, column, lane.
#[derive(Debug)]
pub(super) struct LaneRows {
    columns: usize,
    lanes: usize,
    values: AlignedBuffer,
}

impl LaneRows {
    pub(super) fn new(columns: usize, lanes: usize) -> Self {
        let mut values = AlignedBuffer::new();
        values.resize(BLOCK * columns * lanes);
        values.as_mut_slice().fill(0.0);
        Self { columns, lanes, values }
    }

    /// One row.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.values.as_slice()[row * self.columns * self.lanes..][..self.columns * self.lanes]
    }

    /// Writes `values` into one row, from column `from` on.
    #[inline(always)]
    pub(super) fn put<T: Lane>(&mut self, row: usize, from: usize, values: &[T]) {
        let to = &mut self.values.as_mut_slice()[(row * self.columns + from) * T::LANES..][..values.len() * T::LANES];
        for (to, value) in to.chunks_exact_mut(T::LANES).zip(values) {
            value.store(to);
        }
    }

    /// Writes one number of one lane.
    #[inline(always)]
    pub(super) fn put_one(&mut self, row: usize, column: usize, lane: usize, value: f64) {
        self.values.as_mut_slice()[(row * self.columns + column) * self.lanes + lane] = value;
    }

    /// Writes the first values of a column and lane into `to`.
    #[inline(always)]
    pub(super) fn take_column(&self, column: usize, lane: usize, to: &mut [f64]) {
        let stride = self.columns * self.lanes;
        let from = &self.values.as_slice()[column * self.lanes + lane..];
        for (to, from) in to.iter_mut().zip(from.iter().step_by(stride)) {
            *to = *from;
        }
    }

    /// Fills a lane with samples `first..first + rows` of a reference: positions, velocities and, where there is room,
    /// accelerations of all joints.
    pub(super) fn take_reference(&mut self, lane: usize, reference: &Reference, first: usize, rows: usize) {
        let motion = reference.motion();
        let (joints, stride) = (motion.joints, self.columns * self.lanes);
        let places = self.columns / joints;
        for (place, array) in [&motion.q, &motion.dq, &motion.ddq].into_iter().take(places).enumerate() {
            for joint in 0..joints {
                let from = &array[joint * motion.samples + first..][..rows];
                let to = &mut self.values.as_mut_slice()[(place * joints + joint) * self.lanes + lane..];
                for (to, from) in to.iter_mut().step_by(stride).zip(from) {
                    *to = *from;
                }
            }
        }
    }
}
