//! Triangular factors of the rows of one recording.

use crate::examination::PriorAgreement;
use crate::settings::IdentificationSettings;
use dynident_estimation::{EstimationError, SegmentedFactor};
use dynident_rows::{JointRows, LogError, LogPass, LogStatistics, Logs, RegressorModel, RowBlock, RowConsumer};
use rayon::prelude::*;

/// Data of one recording for the fit.
#[derive(Clone, Debug)]
pub struct LogFactors {
    /// Index of the recording.
    pub index: usize,
    /// One triangular factor of `[W | τ]` (regressor W, torque τ) for each joint, divided into time segments.
    pub factors: Vec<SegmentedFactor>,
    /// Import report and statistics of the pass.
    pub statistics: LogStatistics,
    /// Contribution of position noise to the rows, one triangular factor for each joint. `None` until the model is
    /// selected, and if the noise is unknown.
    pub noise: Option<Vec<SegmentedFactor>>,
    /// Agreement of the log with the nominal values, if they are known and the torque is in newton metres; for the
    /// model that was given to [`training_rows`](crate::training_rows).
    pub nominal_agreement: Option<PriorAgreement>,
}

impl LogFactors {
    /// Merges each joint's rows into one time segment. This is sufficient for the values, and for error bars that
    /// assume white noise.
    pub(crate) fn as_one_segment(&self) -> Self {
        let factors = self.factors.par_iter().map(SegmentedFactor::as_one_segment).collect();
        let (statistics, nominal_agreement) = (self.statistics.clone(), self.nominal_agreement.clone());
        Self { index: self.index, factors, statistics, noise: self.noise.clone(), nominal_agreement }
    }

    /// Rows for another model, whose columns are a subset of the columns of `wide`.
    pub(crate) fn of(mut self, wide: &RegressorModel, model: &RegressorModel) -> Result<Self, EstimationError> {
        self.factors.par_iter_mut().enumerate().try_for_each(|(joint, factor)| {
            let seen = wide.layout().joint_columns(joint);
            // A missing column gets an index out of range, which the selection of columns rejects.
            let place = |&column: &usize| {
                let wanted = &model.layout().columns()[column];
                seen.iter().position(|&global| wide.layout().columns()[global] == *wanted).unwrap_or(usize::MAX)
            };
            let places: Vec<usize> = model.layout().joint_columns(joint).iter().map(place).collect();
            *factor = factor.selected(&places)?;
            Ok(())
        })?;
        Ok(self)
    }
}

struct FactorConsumer(Vec<JointFactor>);

struct JointFactor {
    log: String,
    factor: SegmentedFactor,
    block: RowBlock,
    counted: Vec<f64>,
}

impl RowConsumer for FactorConsumer {
    fn reads_samples(&self) -> bool {
        false
    }

    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0[rows.joint].filtered(rows)
    }

    fn joints(&mut self) -> Option<Vec<&mut (dyn RowConsumer + Send)>> {
        Some(self.0.iter_mut().map(|joint| joint as &mut (dyn RowConsumer + Send)).collect())
    }
}

impl RowConsumer for JointFactor {
    fn reads_samples(&self) -> bool {
        false
    }

    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        let rows = rows.counted(&mut self.counted);
        self.block
            .push(rows.panel, rows.rows, |panel, rows| self.factor.absorb(panel, rows))
            .map_err(|source| LogError::Rows { log: self.log.clone(), source })
    }
}

/// Computes the triangular factors of recording `index`; `alone` allows a second thread that reads the file.
///
/// # Errors
/// The recording cannot be read.
pub fn log_factors(
    logs: &Logs<'_>,
    settings: &IdentificationSettings,
    model: &RegressorModel,
    index: usize,
    alone: bool,
) -> Result<LogFactors, LogError> {
    let log = logs.recordings[index].label();
    let in_rows = |source| LogError::Rows { log: log.clone(), source };
    let joint = |joint: usize| {
        let columns = model.layout().joint_columns(joint);
        let factor = SegmentedFactor::new(columns.len(), settings.estimation.segments).map_err(in_rows)?;
        let block = RowBlock::new(columns.len() + 1);
        Ok(JointFactor { log: log.clone(), factor, block, counted: Vec::new() })
    };
    let mut consumer = FactorConsumer((0..model.dof()).map(joint).collect::<Result<_, LogError>>()?);
    let pass = LogPass { reader_thread: alone && logs.execution.parallel(), ..logs.pass(model, index) };
    let statistics = pass.run(&mut consumer)?;
    let mut factors = Vec::with_capacity(model.dof());
    for JointFactor { mut factor, block, .. } in consumer.0 {
        block.finish(|panel, rows| factor.absorb(panel, rows)).map_err(in_rows)?;
        factors.push(factor);
    }
    Ok(LogFactors { index, factors, statistics, noise: None, nominal_agreement: None })
}
