//! Signs in a fit that the study may contain a mistake.

use crate::diagnosis::{has_jumps, is_beyond_limits};
use crate::training::Training;
use dynident_model::Model;

/// Mean over joints of `ln(residual of a consistent robot / residual of separate joint parameters)` above which
/// alternative hypotheses are tested. Simulated and well-described robots stay below 0.05.
const DOUBTFUL: f64 = 0.1;
/// Minimum number of rows per parameter of a joint; with fewer rows the separate fit follows the noise.
const TELLING_ROWS: f64 = 4.0 / 3.0;

/// Whether a training recording has jumps that no motion causes.
pub(crate) fn have_jumps(training: &Training) -> bool {
    training.logs.iter().filter_map(|log| log.statistics.report.as_ref()).any(has_jumps)
}

/// Whether a training recording has a joint beyond its limits or an impossible rate.
pub(crate) fn break_limits(training: &Training, model: &Model) -> bool {
    let reports = training.logs.iter().filter_map(|log| log.statistics.report.as_ref());
    reports.into_iter().any(|report| is_beyond_limits(model, report))
}

/// Whether the residual of a consistent robot with base parameters `consistent` is clearly larger than that of separate
/// parameters for each joint, or there is no such robot, or there are too few rows.
pub(crate) fn is_doubtful(training: &Training, consistent: Option<&[f64]>) -> bool {
    let Some(theta) = consistent else { return true };
    let mut sums = vec![JointSums::default(); training.problem.joints().len()];
    for equation in training.problem.equations() {
        let factor = equation.factor.total();
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta.get(column).copied().unwrap_or(0.0)).collect();
        let columns = equation.columns.len();
        let sum = &mut sums[equation.joint];
        sum.left += factor.residual_sum_of_squares(&own).unwrap_or(f64::INFINITY);
        sum.alone += factor.entry(columns, columns).powi(2);
        sum.torque += factor.torque_norm().powi(2);
        sum.rows += factor.rows() as f64;
        sum.columns += columns as f64;
    }
    let moving: Vec<&JointSums> = sums.iter().filter(|sum| sum.torque > 0.0).collect();
    moving.iter().any(|sum| sum.rows < TELLING_ROWS * sum.columns)
        || moving.iter().map(|sum| sum.more_by_one_robot()).sum::<f64>() > DOUBTFUL * moving.len() as f64
}

/// Sums of squares of one joint's equations.
#[derive(Clone, Copy, Default)]
struct JointSums {
    /// Residual of the consistent robot, N² m².
    left: f64,
    /// Residual of separate parameters for the joint.
    alone: f64,
    torque: f64,
    rows: f64,
    columns: f64,
}

impl JointSums {
    /// Logarithm of the ratio of both residuals. The joint's own residual is corrected for overfitting by `n / (n - p)`
    /// in the squares.
    fn more_by_one_robot(&self) -> f64 {
        // Residuals below a hundredth of the torque are ignored.
        let floor = 1e-4 * self.torque;
        let noise = self.alone * self.rows / (self.rows - self.columns);
        (0.5 * (self.left.max(floor) / noise.max(floor)).ln()).max(0.0)
    }
}
