//! Every row of the training logs once more, for estimators that reweight them.

use super::{EstimatorError, TrainingRows};
use crate::recording::LogError;
use crate::rows::{JointRows, RowConsumer};
use dynident_estimation::{EstimationError, RowBlock, RowVisitor};

/// What stops an estimator that comes back to the logs: itself, or what reads or simulates them.
pub(crate) enum Stop {
    Estimator(EstimationError),
    Log(EstimatorError),
}

impl From<EstimationError> for Stop {
    fn from(error: EstimationError) -> Self {
        Self::Estimator(error)
    }
}

/// Hands a log's rows to a visitor.
struct VisitorConsumer<'a, 'b> {
    log: usize,
    visit: &'a mut RowVisitor<'b>,
    refused: Option<EstimationError>,
    counted: Vec<f64>,
}

impl RowConsumer for VisitorConsumer<'_, '_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        if self.refused.is_none() {
            let rows = rows.counted(&mut self.counted);
            let block = RowBlock { log: self.log, joint: rows.joint, rows: rows.rows, panel: rows.panel };
            self.refused = (self.visit)(&block).err();
        }
        Ok(())
    }
}

impl From<Stop> for EstimatorError {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Estimator(source) => Self::Estimation(source),
            Stop::Log(error) => error,
        }
    }
}

/// One pass: every row of every training log.
pub(super) fn every_row(rows: &TrainingRows<'_>, visit: &mut RowVisitor<'_>) -> Result<(), Stop> {
    rows.begin("reweighting rows");
    for (log, &index) in rows.training.iter().enumerate() {
        let mut consumer = VisitorConsumer { log, visit: &mut *visit, refused: None, counted: Vec::new() };
        rows.logs.pass(rows.model, index).run(&mut consumer).map_err(|error| Stop::Log(error.into()))?;
        if let Some(refused) = consumer.refused {
            return Err(refused.into());
        }
    }
    rows.logs.end();
    Ok(())
}
