//! Tests on a fit that indicate a mistake in the study.

use crate::diagnosis::{MotionLimits, has_jumps, is_beyond_limits};
use crate::thresholds::DoubtThresholds;
use crate::training::Training;
use dynident_model::Model;

/// Whether a training recording has jumps that no motion causes.
pub(crate) fn have_jumps(training: &Training) -> bool {
    training.logs.iter().filter_map(|log| log.statistics.report.as_ref()).any(has_jumps)
}

/// Whether a joint exceeds its limits in a training recording, or a training recording has an implausible rate.
pub(crate) fn break_limits(training: &Training, model: &Model, limits: &MotionLimits) -> bool {
    let reports = training.logs.iter().filter_map(|log| log.statistics.report.as_ref());
    reports.into_iter().any(|report| is_beyond_limits(model, report, limits))
}

/// Whether a fit is doubtful. This is the case if the residual of the physically consistent robot (base parameters
/// `consistent`) is clearly larger than that of separate parameters for each joint, if there is no such robot, or if
/// there are too few rows.
pub(crate) fn is_doubtful(training: &Training, consistent: Option<&[f64]>, thresholds: &DoubtThresholds) -> bool {
    let Some(theta) = consistent else { return true };
    let mut sums = vec![JointSums::default(); training.problem.joints().len()];
    for equation in training.problem.equations() {
        let factor = equation.factor.total();
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta.get(column).copied().unwrap_or(0.0)).collect();
        let columns = equation.columns.len();
        let sum = &mut sums[equation.joint];
        sum.of_robot += factor.residual_sum_of_squares(&own).unwrap_or(f64::INFINITY);
        sum.of_joint += factor.entry(columns, columns).powi(2);
        sum.torque += factor.torque_norm().powi(2);
        sum.rows += factor.rows() as f64;
        sum.columns += columns as f64;
    }
    let moving: Vec<&JointSums> = sums.iter().filter(|sum| sum.torque > 0.0).collect();
    moving.iter().any(|sum| sum.rows < thresholds.min_rows_per_parameter * sum.columns)
        || moving.iter().map(|sum| sum.log_residual_ratio()).sum::<f64>()
            > thresholds.max_log_residual_ratio * moving.len() as f64
}

#[derive(Clone, Copy, Default)]
struct JointSums {
    /// Sum of squared residuals of the physically consistent robot, N² m².
    of_robot: f64,
    of_joint: f64,
    torque: f64,
    rows: f64,
    columns: f64,
}

impl JointSums {
    /// Logarithm of the ratio of the residual with the physically consistent robot to that with separate parameters of
    /// the joint. The square of the latter is corrected for overfitting by `n / (n - p)`, with n rows and p parameters.
    fn log_residual_ratio(&self) -> f64 {
        // Residuals below a hundredth of the torque are treated as equal to it.
        let floor = 1e-4 * self.torque;
        let noise = self.of_joint * self.rows / (self.rows - self.columns);
        (0.5 * (self.of_robot.max(floor) / noise.max(floor)).ln()).max(0.0)
    }
}
