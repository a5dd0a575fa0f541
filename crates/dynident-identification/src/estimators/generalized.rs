//! Generalised least squares: the rows of all joints at an instant are combined in one triangular factor.

use super::{EstimatorError, Findings, TrainingRows};
use dynident_estimation::{CrossProblem, Estimate, SegmentedFactor, generalized_least_squares};
use dynident_rows::{JointRows, LogError, RowConsumer};

struct SideBySide {
    factor: SegmentedFactor,
    panel: Vec<f64>,
    /// For each row, the smallest coverage over the joints; empty if all samples are valid.
    coverage: Vec<f64>,
    counted: Vec<f64>,
    joints: usize,
}

impl RowConsumer for SideBySide {
    fn filtered(&mut self, rows: &JointRows<'_>) -> Result<(), LogError> {
        // The joints of a block arrive in order, with the same number of rows.
        if rows.joint == 0 {
            self.panel.clear();
            self.coverage.clear();
        }
        self.panel.extend_from_slice(rows.panel);
        if !rows.coverage.is_empty() {
            self.coverage.resize(rows.rows, 1.0);
            self.coverage.iter_mut().zip(rows.coverage).for_each(|(least, own)| *least = least.min(*own));
        }
        if rows.joint + 1 == self.joints {
            // An instant is valid only if it is valid for every joint.
            let all = JointRows { panel: &self.panel, coverage: &self.coverage, ..*rows };
            let counted = all.counted(&mut self.counted);
            self.factor.absorb(counted.panel, counted.rows)?;
        }
        Ok(())
    }
}

pub(super) fn generalized(rows: &TrainingRows<'_>) -> Result<(Estimate, Findings), EstimatorError> {
    let TrainingRows { logs, model, problem, .. } = *rows;
    let settings = rows.settings;
    let joints = problem.joints().len();
    let lists = (0..joints).map(|joint| model.layout().joint_columns(joint).to_vec()).collect();
    let mut cross = CrossProblem::new(problem.columns().to_vec(), problem.joints().to_vec(), lists)
        .and_then(|cross| cross.with_fallback(problem.fallback().to_vec()))
        .and_then(|cross| cross.with_unexcited(problem.unexcited().clone()))?;
    rows.begin("joints side by side");
    for (place, &index) in rows.training.iter().enumerate() {
        let factor = SegmentedFactor::new(cross.width(), settings.segments)?;
        let [panel, coverage, counted] = [(); 3].map(|()| Vec::new());
        let mut consumer = SideBySide { factor, panel, coverage, counted, joints };
        logs.pass(model, index).run(&mut consumer)?;
        cross.add(&problem.logs()[place], consumer.factor)?;
    }
    logs.end();
    let found = generalized_least_squares(&cross, &settings.weighted())?;
    let rows = found.noise_correlation.row_iter();
    let correlation = rows.map(|row| row.iter().copied().collect()).collect();
    Ok((found.estimate, Findings::NoiseCorrelation(correlation)))
}
