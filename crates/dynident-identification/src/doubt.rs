//! Do a fit's own figures give reason to read its recordings otherwise?

use crate::diagnosis::{has_jumps, is_beyond_limits};
use crate::training::Training;
use dynident_model::Model;

/// Per joint: what a consistent robot leaves more than parameters of each joint's own do, as a logarithm, before other
/// readings are tried unasked. Simulated and well-described robots stay below 0.05.
const DOUBTFUL: f64 = 0.1;

/// Whether a training recording has jumps that no motion makes.
pub(crate) fn have_jumps(training: &Training) -> bool {
    training.logs.iter().filter_map(|log| log.statistics.report.as_ref()).any(has_jumps)
}

/// Whether a training recording has a joint beyond its limits, or a rate that no recorder has.
pub(crate) fn break_limits(training: &Training, model: &Model) -> bool {
    let reports = training.logs.iter().filter_map(|log| log.statistics.report.as_ref());
    reports.into_iter().any(|report| is_beyond_limits(model, report))
}

/// Whether a consistent robot with base parameters `consistent` leaves clearly more of the torque than parameters of
/// each joint's own, or there is no such robot.
pub(crate) fn is_doubtful(training: &Training, consistent: Option<&[f64]>) -> bool {
    let Some(theta) = consistent else { return true };
    let mut sums = vec![(0.0, 0.0, 0.0_f64); training.problem.joints().len()];
    for equation in training.problem.equations() {
        let factor = equation.factor.total();
        let own: Vec<f64> = equation.columns.iter().map(|&column| theta.get(column).copied().unwrap_or(0.0)).collect();
        let columns = equation.columns.len();
        let sum = &mut sums[equation.joint];
        sum.0 += factor.residual_sum_of_squares(&own).unwrap_or(f64::INFINITY);
        sum.1 += factor.entry(columns, columns).powi(2);
        sum.2 += factor.torque_norm().powi(2);
    }
    // Below a hundredth of the torque nothing is left.
    let log = |(left, alone, torque): &(f64, f64, f64)| {
        let floor = 1e-4 * torque;
        if *torque > 0.0 { 0.5 * (left.max(floor) / alone.max(floor)).ln() } else { 0.0 }
    };
    sums.iter().map(log).sum::<f64>() > DOUBTFUL * sums.len() as f64
}
