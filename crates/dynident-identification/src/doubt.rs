//! Do a fit's own figures give reason to read its recordings otherwise?

use crate::diagnosis::{MotionLimits, has_jumps, is_beyond_limits};
use crate::training::Training;
use dynident_model::Model;

/// Per joint: what a consistent robot leaves more than parameters of each joint's own do, as a logarithm, before other
/// readings are tried unasked. Simulated and well-described robots stay below 0.05.
const DOUBTFUL: f64 = 0.1;
/// Rows for each parameter of a joint's own below which these follow the noise and tell nothing.
const TELLING_ROWS: f64 = 4.0 / 3.0;

/// Whether a training recording has jumps that no motion makes.
pub(crate) fn have_jumps(training: &Training) -> bool {
    training.logs.iter().filter_map(|log| log.statistics.report.as_ref()).any(has_jumps)
}

/// Whether a training recording has a joint beyond its limits, or a rate that no recorder has.
pub(crate) fn break_limits(training: &Training, model: &Model, limits: &MotionLimits) -> bool {
    let reports = training.logs.iter().filter_map(|log| log.statistics.report.as_ref());
    reports.into_iter().any(|report| is_beyond_limits(model, report, limits))
}

/// Whether a consistent robot with base parameters `consistent` leaves clearly more of the torque than parameters of
/// each joint's own, or there is no such robot, or there are too few rows to tell.
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
    /// Left by the consistent robot, N² m².
    left: f64,
    /// Left by parameters of the joint's own.
    alone: f64,
    torque: f64,
    rows: f64,
    columns: f64,
}

impl JointSums {
    /// The logarithm of what one robot for all joints leaves over what the joint's own parameters leave, these freed of
    /// what they follow of the noise: `n / (n - p)` in the squares.
    fn more_by_one_robot(&self) -> f64 {
        // Below a hundredth of the torque nothing is left.
        let floor = 1e-4 * self.torque;
        let noise = self.alone * self.rows / (self.rows - self.columns);
        (0.5 * (self.left.max(floor) / noise.max(floor)).ln()).max(0.0)
    }
}
