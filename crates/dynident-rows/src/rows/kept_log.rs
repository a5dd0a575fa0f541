//! Storage of the motion of a log between passes.

use super::row_store::RowStore;
use dynident_recording::{ImportReport, MotionBlock};

/// Maximum number of stored values of the motion of one log (256 MiB).
pub(super) const MAX_KEPT_VALUES: usize = 1 << 25;

/// Motion of a log in memory, so that the log is read only once.
#[derive(Debug)]
pub struct KeptLog {
    pub(super) blocks: Vec<MotionBlock>,
    pub(super) rate_hz: f64,
    pub(super) report: ImportReport,
    /// Filtered rows of earlier passes.
    pub(super) rows: RowStore,
}

impl KeptLog {
    pub(super) fn new(blocks: Vec<MotionBlock>, rate_hz: f64, report: ImportReport) -> Self {
        Self { blocks, rate_hz, report, rows: RowStore::default() }
    }

    pub(super) fn samples(&self) -> usize {
        self.blocks.iter().map(|block| block.rows).sum()
    }
}

/// Stores blocks of a motion until they exceed the memory limit.
pub(super) struct BlockCache {
    pub(super) blocks: Option<Vec<MotionBlock>>,
    values: usize,
}

impl BlockCache {
    pub(super) fn new(is_enabled: bool) -> Self {
        Self { blocks: is_enabled.then(Vec::new), values: 0 }
    }

    /// Stores the block, or returns it if it does not fit.
    pub(super) fn keep(&mut self, block: MotionBlock) -> Option<MotionBlock> {
        let MotionBlock { q, dq, ddq, tau, tau_smooth, temperature_c, .. } = &block;
        // A mark takes an eighth of the memory of a value.
        self.values += block.set_aside.len() / 8;
        self.values += [q, dq, ddq, tau, tau_smooth, temperature_c].into_iter().map(Vec::len).sum::<usize>();
        if self.values > MAX_KEPT_VALUES {
            self.blocks = None;
        }
        match &mut self.blocks {
            Some(blocks) => {
                blocks.push(block);
                None
            }
            None => Some(block),
        }
    }
}
