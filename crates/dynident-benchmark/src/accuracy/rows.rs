//! Rows of one trial as in `identify`, and estimates from them.

use super::BenchmarkError;
use super::scenario::Scenario;
use core::cell::OnceCell;
use dynident_dynamics::Column;
use dynident_estimation::{
    CovarianceMethod, Estimate, EstimationError, InstrumentedProblem, LinearProblem, RowBlock, RowVisitor,
    SegmentedFactor,
};
use dynident_identification::estimators::{Estimator, TrainingRows, estimate};
use dynident_identification::rows::{JointRows, RowConsumer};
use dynident_identification::{
    Execution, IdentificationError, IdentificationSettings, LogError, Logs, MotionRecord, Recording, Silent,
    log_factors,
};
use dynident_recording::MotionBlock;
use std::sync::Arc;

const LOG: &str = "run";

/// Rows of all joints from a given motion, with their triangular factors.
#[derive(Debug)]
pub struct Rows<'a> {
    scenario: &'a Scenario,
    recordings: [Recording; 1],
    settings: IdentificationSettings,
    pub(super) problem: LinearProblem,
    blocks: OnceCell<Vec<Block>>,
}

#[derive(Debug)]
struct Block {
    joint: usize,
    rows: usize,
    panel: Vec<f64>,
}

struct BlockStore(Vec<Block>);

impl RowConsumer for BlockStore {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        self.0.push(Block { joint: rows.joint, rows: rows.rows, panel: rows.panel.to_vec() });
        Ok(())
    }
}

impl<'a> Rows<'a> {
    /// Filter and decimation follow from the cut-off as in `identify`. Without a cut-off all samples are used
    /// unfiltered.
    pub(super) fn new(
        scenario: &'a Scenario,
        motion: &MotionBlock,
        cutoff_hz: Option<f64>,
    ) -> Result<Self, BenchmarkError> {
        let motion = Arc::new(motion.clone());
        let record = MotionRecord { label: LOG.to_owned(), motion, usable: Vec::new(), windows: None, raw: None };
        let recordings = [Recording::of_motion(LOG, record)];
        let mut settings = IdentificationSettings::default();
        match cutoff_hz {
            Some(cutoff_hz) => {
                settings.motion.differentiator = settings.motion.differentiator.with_cutoff(cutoff_hz);
            }
            None => settings.parallel_filter.enabled = false,
        }
        let model = &scenario.model;
        let columns = model.layout().columns().iter().map(Column::symbol).collect();
        let mut problem = LinearProblem::new(columns, model.joint_names());
        let logs = logs(scenario, &recordings, &settings).map_err(IdentificationError::from)?;
        let factors = log_factors(&logs, &settings, model, 0, false).map_err(IdentificationError::from)?.factors;
        for (joint, factor) in factors.into_iter().enumerate() {
            problem
                .add(LOG, joint, model.layout().joint_columns(joint).to_vec(), factor)
                .map_err(IdentificationError::from)?;
        }
        Ok(Self { scenario, recordings, settings, problem, blocks: OnceCell::new() })
    }

    /// The estimate of `identify` for these rows.
    pub(super) fn estimate(
        &self,
        estimator: Estimator,
        covariance: CovarianceMethod,
    ) -> Result<Estimate, IdentificationError> {
        let mut settings = self.settings.clone();
        (settings.estimation.estimator, settings.estimation.covariance) = (estimator, covariance);
        let logs = logs(self.scenario, &self.recordings, &settings)?;
        let rows = TrainingRows {
            logs: &logs,
            model: &self.scenario.model,
            training: &[0],
            problem: &self.problem,
            settings: &settings.estimation,
            consistency: settings.consistency.as_ref(),
        };
        Ok(estimate(&rows, None)?.estimate)
    }

    fn blocks(&self) -> Result<&[Block], IdentificationError> {
        if let Some(blocks) = self.blocks.get() {
            return Ok(blocks);
        }
        let mut kept = BlockStore(Vec::new());
        logs(self.scenario, &self.recordings, &self.settings)?.pass(&self.scenario.model, 0).run(&mut kept)?;
        Ok(self.blocks.get_or_init(|| kept.0))
    }

    pub(super) fn pass(&self, visit: &mut RowVisitor<'_>) -> Result<(), EstimationError> {
        // Rows that were computed once can be computed again.
        self.blocks().map_err(|_| EstimationError::Empty)?.iter().try_for_each(|block| {
            visit(&RowBlock { log: 0, joint: block.joint, rows: block.rows, panel: &block.panel })
        })
    }

    /// These rows preceded by those of `instruments`, which must have the same filter.
    pub(super) fn instrumented(&self, instruments: &Self) -> Result<InstrumentedProblem, IdentificationError> {
        let (problem, layout) = (&self.problem, self.scenario.model.layout());
        let mut instrumented = InstrumentedProblem::new(problem.columns().to_vec(), problem.joints().to_vec());
        let (own, other) = (self.blocks()?, instruments.blocks()?);
        for joint in 0..problem.joints().len() {
            let columns = layout.joint_columns(joint);
            let mut factor = SegmentedFactor::new(2 * columns.len(), self.settings.estimation.segments)?;
            for (block, other) in own.iter().zip(other).filter(|(block, _)| block.joint == joint) {
                let z = other.panel.get(..columns.len() * block.rows).ok_or(EstimationError::Empty)?;
                factor.absorb(&[z, &block.panel].concat(), block.rows)?;
            }
            instrumented.add(LOG, joint, columns, factor)?;
        }
        Ok(instrumented)
    }
}

/// The recording with its filters, on this thread.
fn logs<'b>(
    scenario: &Scenario,
    recordings: &'b [Recording],
    settings: &'b IdentificationSettings,
) -> Result<Logs<'b>, LogError> {
    let alone = Execution { threads: 1, progress: &Silent };
    Logs::new(scenario.model.model(), recordings, settings.row_settings(), &[], None, alone)
}
