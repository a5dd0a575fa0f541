//! Filtered rows of a motion in memory, and the problems that estimators make of them.

use super::BenchmarkError;
use super::scenario::Scenario;
use crate::study::EstimatorSection;
use dynident_dynamics::Column;
use dynident_estimation::{
    CrossProblem, EstimationError, InstrumentedProblem, LinearProblem, RowBlock, RowVisitor, SegmentedFactor,
};
use dynident_identification::rows::{JointRows, ParallelFilterSettings, RowBuilder, RowConsumer};
use dynident_identification::{IdentificationError, RegressorModel};
use dynident_recording::MotionBlock;

/// Name of the one log.
const LOG: &str = "run";

/// Rows of all joints, as they left the parallel filter.
#[derive(Debug)]
pub struct Rows<'a> {
    scenario: &'a Scenario,
    blocks: Vec<Block>,
}

#[derive(Debug)]
struct Block {
    joint: usize,
    rows: usize,
    panel: Vec<f64>,
}

impl RowConsumer for Rows<'_> {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), IdentificationError> {
        self.blocks.push(Block { joint: rows.joint, rows: rows.rows, panel: rows.panel.to_vec() });
        Ok(())
    }
}

impl<'a> Rows<'a> {
    /// Filter and decimation follow from the cut-off as in `identify`. Without a cut-off every sample as it is.
    pub(super) fn new(
        scenario: &'a Scenario,
        motion: &MotionBlock,
        cutoff_hz: Option<f64>,
    ) -> Result<Self, BenchmarkError> {
        let defaults = ParallelFilterSettings::default();
        let filter = cutoff_hz.and_then(|cutoff| defaults.decimation(motion.rate_hz, Some(cutoff)));
        let model = RegressorModel::from(scenario.parametric.clone());
        let places: Vec<usize> = (0..model.dof()).collect();
        let mut rows = Self { scenario, blocks: Vec::new() };
        RowBuilder::new(&model, &places, motion.rate_hz, filter.as_ref())
            .map_err(|source| BenchmarkError::Filter { robot: scenario.robot.to_owned(), source })?
            .take(motion, &mut rows)
            .map_err(|source| BenchmarkError::Pipeline(Box::new(source)))?;
        Ok(rows)
    }

    fn names(&self) -> (Vec<String>, Vec<String>) {
        let columns = self.scenario.parametric.layout().columns().iter().map(Column::symbol).collect();
        (columns, self.scenario.parametric.model().joints().iter().map(|joint| joint.name.clone()).collect())
    }

    fn columns(&self, joint: usize) -> &[usize] {
        self.scenario.parametric.layout().joint_columns(joint)
    }

    /// The joints' rows as triangular factors.
    pub(super) fn problem(&self) -> Result<LinearProblem, EstimationError> {
        let (columns, joints) = self.names();
        let mut problem = LinearProblem::new(columns, joints);
        for joint in 0..self.scenario.parametric.model().dof() {
            let own = self.columns(joint);
            let mut factor = SegmentedFactor::new(own.len(), EstimatorSection::default().segments)?;
            for block in self.blocks.iter().filter(|block| block.joint == joint) {
                factor.absorb(&block.panel, block.rows)?;
            }
            problem.add(LOG, joint, own.to_vec(), factor)?;
        }
        Ok(problem)
    }

    /// Hands every row to a visitor.
    pub(super) fn pass(&self, visit: &mut RowVisitor<'_>) -> Result<(), EstimationError> {
        self.blocks.iter().try_for_each(|block| {
            visit(&RowBlock { log: 0, joint: block.joint, rows: block.rows, panel: &block.panel })
        })
    }

    /// The joints side by side.
    pub(super) fn cross(&self) -> Result<CrossProblem, EstimationError> {
        let (columns, joints) = self.names();
        let count = joints.len();
        let lists = (0..count).map(|joint| self.columns(joint).to_vec()).collect();
        let mut cross = CrossProblem::new(columns, joints, lists)?;
        let mut factor = SegmentedFactor::new(cross.width(), EstimatorSection::default().segments)?;
        // Joints of a block come in their order, with as many rows each.
        for blocks in self.blocks.chunks(count) {
            let panel: Vec<f64> = blocks.iter().flat_map(|block| block.panel.iter().copied()).collect();
            factor.absorb(&panel, blocks[0].rows)?;
        }
        cross.add(LOG, factor)?;
        Ok(cross)
    }

    /// These rows with those of `instruments` in front, which must come from the same filter.
    pub(super) fn instrumented(&self, instruments: &Self) -> Result<InstrumentedProblem, EstimationError> {
        let (columns, joints) = self.names();
        let mut problem = InstrumentedProblem::new(columns, joints);
        for joint in 0..self.scenario.parametric.model().dof() {
            let own = self.columns(joint);
            let mut factor = SegmentedFactor::new(2 * own.len(), EstimatorSection::default().segments)?;
            let pairs = self.blocks.iter().zip(&instruments.blocks);
            for (block, other) in pairs.filter(|(block, _)| block.joint == joint) {
                let z = other.panel.get(..own.len() * block.rows).ok_or(EstimationError::Empty)?;
                factor.absorb(&[z, &block.panel].concat(), block.rows)?;
            }
            problem.add(LOG, joint, own, factor)?;
        }
        Ok(problem)
    }

    /// Root mean square of the difference of each column to that of other rows of the same filter.
    pub(super) fn column_differences(&self, other: &Self) -> Vec<f64> {
        let count = self.scenario.parametric.layout().columns().len();
        let (mut squares, mut rows) = (vec![0.0; count], vec![0_usize; count]);
        for (a, b) in self.blocks.iter().zip(&other.blocks) {
            let columns = a.panel.chunks_exact(a.rows).zip(b.panel.chunks_exact(a.rows));
            for (&column, (a, b)) in self.columns(a.joint).iter().zip(columns) {
                squares[column] += a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                rows[column] += a.len();
            }
        }
        squares.iter().zip(rows).map(|(square, rows)| (square / rows.max(1) as f64).sqrt()).collect()
    }
}
