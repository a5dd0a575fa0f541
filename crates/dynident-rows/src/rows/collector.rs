//! Consumers that collect the filtered rows of a pass.

use super::{JointRows, RowConsumer};
use crate::recording::LogError;

/// Maximum number of values of filtered rows that are stored per log (64 MiB).
pub(super) const MAX_STORED_VALUES: usize = 1 << 23;

pub(super) struct Collector {
    /// Number of rows per panel of samples.
    pub(super) pieces: Vec<usize>,
    pub(super) joints: Vec<CollectedJoint>,
}

#[derive(Clone, Default)]
pub(super) struct CollectedJoint {
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) coverage: Vec<f64>,
}

impl Collector {
    pub(super) fn new(dof: usize) -> Self {
        Self { pieces: Vec::new(), joints: vec![CollectedJoint::default(); dof] }
    }
}

impl RowConsumer for Collector {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        if rows.joint == 0 {
            self.pieces.push(rows.rows);
        }
        let joint = &mut self.joints[rows.joint];
        joint.columns.resize_with(rows.panel.len() / rows.rows, Vec::new);
        for (column, values) in joint.columns.iter_mut().zip(rows.panel.chunks_exact(rows.rows)) {
            column.extend_from_slice(values);
        }
        if rows.coverage.is_empty() {
            joint.coverage.resize(joint.coverage.len() + rows.rows, 1.0);
        } else {
            joint.coverage.extend_from_slice(rows.coverage);
        }
        Ok(())
    }

    fn reads_samples(&self) -> bool {
        false
    }
}

/// Passes rows on to a consumer and stores them while they fit into memory.
pub(super) struct ForwardingCollector<'c> {
    consumer: &'c mut dyn RowConsumer,
    /// Stored rows; `None` once they exceed the limit.
    pub(super) rows: Option<Collector>,
    values: usize,
}

impl<'c> ForwardingCollector<'c> {
    pub(super) fn new(consumer: &'c mut dyn RowConsumer, dof: usize) -> Self {
        Self { consumer, rows: Some(Collector::new(dof)), values: 0 }
    }
}

impl RowConsumer for ForwardingCollector<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.values += rows.panel.len() + rows.rows;
        self.rows = self.rows.take().filter(|_| self.values <= MAX_STORED_VALUES);
        if let Some(kept) = &mut self.rows {
            kept.filtered(rows)?;
        }
        self.consumer.filtered(rows)
    }

    fn reads_samples(&self) -> bool {
        false
    }
}
