//! Decimation of a log: low-pass of the torque, subsampling of the smooth motion.

use dynident_recording::{Decimator, MotionBlock};
use dynident_rows::{LogError, set_aside};

/// Decimated blocks of a log, piece by piece, joints in the order of the model.
#[derive(Default)]
pub(super) struct Thinned {
    thinning: usize,
    dof: usize,
    pieces: Vec<MotionBlock>,
    segment: Option<usize>,
    decimators: Vec<Decimator>,
    columns: [Vec<Vec<f64>>; 4],
    /// For each joint and sample, whether the torque is invalid; empty if all torques of the piece are valid.
    left_out: Vec<Vec<bool>>,
    out: Vec<f64>,
    rate_hz: f64,
}

impl Thinned {
    /// Creates the storage for a log of `dof` joints with the decimation factor `thinning`.
    pub(super) fn new(thinning: usize, dof: usize) -> Self {
        Self { thinning, dof, ..Self::default() }
    }

    /// Adds the first `rows` rows of a block; `decimator` creates the filter for one joint's torque.
    pub(super) fn take(
        &mut self,
        block: &MotionBlock,
        places: &[usize],
        rows: usize,
        decimator: &dyn Fn() -> Result<Decimator, LogError>,
    ) -> Result<(), LogError> {
        if self.segment != Some(block.segment) {
            self.close();
            self.segment = Some(block.segment);
            self.rate_hz = block.rate_hz;
            self.decimators = (0..self.dof).map(|_| decimator()).collect::<Result<_, _>>()?;
            self.columns = core::array::from_fn(|_| vec![Vec::new(); self.dof]);
            self.left_out.clear();
        }
        if !block.set_aside.is_empty() {
            self.left_out.resize(self.dof, Vec::new());
        }
        for (left_out, (&place, q)) in self.left_out.iter_mut().zip(places.iter().zip(&self.columns[0])) {
            left_out.resize(q.len(), false);
            left_out.extend_from_slice(&set_aside(block, place, 0, rows));
        }
        for (joint, &place) in places.iter().enumerate() {
            for (column, source) in self.columns.iter_mut().zip([&block.q, &block.dq, &block.ddq]) {
                column[joint].extend_from_slice(&block.joint(source, place)[..rows]);
            }
            self.decimators[joint].push(&block.joint(&block.tau, place)[..rows], rows, &mut self.out);
            self.columns[3][joint].extend_from_slice(&self.out);
        }
        Ok(())
    }

    fn close(&mut self) {
        let Some(decimator) = self.decimators.first() else { return };
        let (rows, first) = (self.columns[3].first().map_or(0, Vec::len), decimator.half_length());
        let thinned = |columns: &[Vec<f64>]| -> Vec<f64> {
            columns.iter().flat_map(|x| (0..rows).map(|row| x[first + row * self.thinning])).collect()
        };
        // A decimated sample represents the samples nearest to it. It is valid if at least half of these are valid.
        let (half, all) = (self.thinning / 2, self.columns[0].first().map_or(0, Vec::len));
        let counts_not = |left_out: &[bool], row: usize| {
            let centre = first + row * self.thinning;
            let nearest = &left_out[centre.saturating_sub(half)..(centre + half + 1).min(left_out.len())];
            2 * nearest.iter().filter(|left_out| **left_out).count() > nearest.len()
        };
        let mut set_aside = Vec::new();
        for left_out in &mut self.left_out {
            left_out.resize(all, false);
            set_aside.extend((0..rows).map(|row| counts_not(left_out, row)));
        }
        let [q, dq, ddq, tau] = &self.columns;
        self.pieces.push(MotionBlock {
            rate_hz: self.rate_hz / self.thinning as f64,
            rows,
            joints: self.dof,
            q: thinned(q),
            dq: thinned(dq),
            ddq: thinned(ddq),
            tau: tau.concat(),
            set_aside,
            ..MotionBlock::default()
        });
        self.decimators.clear();
    }

    pub(super) fn finished(mut self) -> Vec<MotionBlock> {
        self.close();
        self.pieces
    }
}
