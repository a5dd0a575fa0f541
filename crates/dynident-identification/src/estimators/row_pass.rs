//! Repeated passes over the rows of training logs, for estimators that change the weights of rows.

use super::{EstimatorError, TrainingRows};
use dynident_estimation::{EstimationError, RowBlock, RowVisitor};
use dynident_rows::{JointRows, LogError, RowConsumer};

/// Error of the estimator, or of the code that reads or simulates logs for the estimator.
pub(crate) enum PassError {
    Estimator(EstimationError),
    Log(EstimatorError),
}

impl From<EstimationError> for PassError {
    fn from(error: EstimationError) -> Self {
        Self::Estimator(error)
    }
}

/// Maximum number of values of filtered rows that are kept in memory (256 MiB).
const MAX_KEPT_VALUES: usize = 1 << 25;

/// Rows of the training logs for repeated passes. They are kept in memory if they fit; otherwise every pass computes
/// them again.
pub(super) struct KeptRows {
    blocks: Option<Vec<KeptBlock>>,
    complete: bool,
}

struct KeptBlock {
    log: usize,
    joint: usize,
    rows: usize,
    panel: Vec<f64>,
}

impl KeptRows {
    pub(super) fn new() -> Self {
        Self { blocks: Some(Vec::new()), complete: false }
    }

    pub(super) fn every_row(&mut self, rows: &TrainingRows<'_>, visit: &mut RowVisitor<'_>) -> Result<(), PassError> {
        if let (Some(blocks), true) = (&self.blocks, self.complete) {
            for KeptBlock { log, joint, rows, panel } in blocks {
                visit(&RowBlock { log: *log, joint: *joint, rows: *rows, panel })?;
            }
            return Ok(());
        }
        rows.begin("reweighting rows");
        let mut numbers = 0;
        for (log, &index) in rows.training.iter().enumerate() {
            let mut keep = |block: &RowBlock<'_>| {
                numbers += block.panel.len();
                if numbers > MAX_KEPT_VALUES {
                    self.blocks = None;
                }
                if let Some(blocks) = &mut self.blocks {
                    let RowBlock { log, joint, rows, panel } = *block;
                    blocks.push(KeptBlock { log, joint, rows, panel: panel.to_vec() });
                }
                visit(block)
            };
            let mut consumer = VisitorConsumer { log, visit: &mut keep, refused: None, counted: Vec::new() };
            rows.logs.pass(rows.model, index).run(&mut consumer).map_err(|error| PassError::Log(error.into()))?;
            if let Some(refused) = consumer.refused {
                return Err(refused.into());
            }
        }
        rows.logs.end();
        self.complete = true;
        Ok(())
    }
}

struct VisitorConsumer<'a, 'b> {
    log: usize,
    visit: &'a mut RowVisitor<'b>,
    refused: Option<EstimationError>,
    counted: Vec<f64>,
}

impl RowConsumer for VisitorConsumer<'_, '_> {
    fn reads_samples(&self) -> bool {
        false
    }

    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        if self.refused.is_none() {
            let rows = rows.counted(&mut self.counted);
            let block = RowBlock { log: self.log, joint: rows.joint, rows: rows.rows, panel: rows.panel };
            self.refused = (self.visit)(&block).err();
        }
        Ok(())
    }
}

impl From<PassError> for EstimatorError {
    fn from(stop: PassError) -> Self {
        match stop {
            PassError::Estimator(source) => Self::Estimation(source),
            PassError::Log(error) => error,
        }
    }
}
