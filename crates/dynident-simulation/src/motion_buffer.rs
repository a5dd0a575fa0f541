//! Buffer between the loop, which processes single samples, and arrays that are stored joint after joint. Without the
//! buffer, every sample would access one memory page for each joint of each array, more than the processor caches.
//! With the buffer this happens once in 32 samples.

use crate::controllers::{Measured, Target};
use crate::reference::Reference;

/// Number of samples in a block; with 35 numbers per sample it has nine kilobytes.
const BLOCK_SAMPLES: usize = 32;

#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    pub(crate) q: &'a [f64],
    pub(crate) dq: &'a [f64],
    pub(crate) tau: &'a [f64],
    /// Measurement, if it differs from the true motion.
    pub(crate) measured: Option<Measured<'a>>,
}

/// Arrays in the order of [`Row`]; the last two contain the measurement.
pub(crate) type Arrays<'a> = [&'a mut Vec<f64>; 5];

#[derive(Debug)]
pub(crate) struct MotionBuffer {
    joints: usize,
    kinds: usize,
    rows: Vec<f64>,
    filled: usize,
    /// Index of the first row's sample.
    first: usize,
}

impl MotionBuffer {
    pub(crate) fn new(joints: usize, with_measured: bool) -> Self {
        let kinds = if with_measured { 5 } else { 3 };
        Self { joints, kinds, rows: vec![0.0; kinds * joints * BLOCK_SAMPLES], filled: 0, first: 0 }
    }

    /// Returns true if the block is full and must be [flushed](Self::flush).
    #[inline]
    pub(crate) fn push(&mut self, row: Row<'_>) -> bool {
        let n = self.joints;
        let to = &mut self.rows[self.filled * self.kinds * n..][..self.kinds * n];
        to[..n].copy_from_slice(row.q);
        to[n..2 * n].copy_from_slice(row.dq);
        to[2 * n..3 * n].copy_from_slice(row.tau);
        if let Some(measured) = row.measured {
            to[3 * n..4 * n].copy_from_slice(measured.q);
            to[4 * n..].copy_from_slice(measured.dq);
        }
        self.filled += 1;
        self.filled == BLOCK_SAMPLES
    }

    /// Writes the rows into arrays of `samples` samples per joint.
    pub(crate) fn flush(&mut self, arrays: Arrays<'_>, samples: usize) {
        let width = self.kinds * self.joints;
        for (place, array) in arrays.into_iter().take(self.kinds).enumerate() {
            for joint in 0..self.joints {
                let column = place * self.joints + joint;
                let to = &mut array[joint * samples + self.first..][..self.filled];
                for (to, value) in to.iter_mut().zip(self.rows[column..].iter().step_by(width)) {
                    *to = *value;
                }
            }
        }
        self.first += self.filled;
        self.filled = 0;
    }
}

#[derive(Debug)]
pub(crate) struct ReferenceBuffer<'a> {
    reference: &'a Reference,
    rows: Vec<f64>,
    at: usize,
}

impl<'a> ReferenceBuffer<'a> {
    pub(crate) fn new(reference: &'a Reference) -> Self {
        Self { reference, rows: vec![0.0; 3 * reference.joints() * BLOCK_SAMPLES], at: 0 }
    }

    #[inline]
    pub(crate) fn go_to(&mut self, sample: usize) {
        self.at = sample % BLOCK_SAMPLES;
        if self.at == 0 {
            self.fill(sample);
        }
    }

    fn fill(&mut self, first: usize) {
        let motion = self.reference.motion();
        let (joints, samples) = (motion.joints, motion.samples);
        let count = BLOCK_SAMPLES.min(samples - first);
        for (place, array) in [&motion.q, &motion.dq, &motion.ddq].into_iter().enumerate() {
            for joint in 0..joints {
                let to = self.rows[place * joints + joint..].iter_mut().step_by(3 * joints);
                for (to, value) in to.zip(&array[joint * samples + first..][..count]) {
                    *to = *value;
                }
            }
        }
    }

    #[inline]
    pub(crate) fn target(&self) -> Target<'_> {
        let n = self.reference.joints();
        let row = &self.rows[self.at * 3 * n..][..3 * n];
        Target { q: &row[..n], dq: &row[n..2 * n], ddq: &row[2 * n..] }
    }
}
