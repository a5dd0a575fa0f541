//! Usual residual of each joint in each bin, as a function of the state of motion.

use crate::quiet::quiet;
use crate::rows::{LogRows, median};

/// Median of the square of a standard normal variable.
const MEDIAN_OF_SQUARED_NORMAL: f64 = 0.4549;

/// Variance of each joint's residual in each bin. It is a robust variance over all bins in the same state of motion
/// (near reversal, slow, fast), plus a share of the dry friction near reversal.
pub(crate) fn usual_variance(rows: &LogRows, residuals: &[Vec<f64>], friction: &[f64], kept: &[bool]) -> Vec<Vec<f64>> {
    let own = rows.settings.usual_residual;
    let moving: Vec<bool> = (0..rows.len()).map(|bin| rows.is_moving(bin)).collect();
    let is_quiet = quiet(rows);
    let of_joint = |joint: usize| -> Vec<f64> {
        let states = states(rows, joint);
        let robust = |is_state: &dyn Fn(usize) -> bool| {
            let used = (0..rows.len()).filter(|&bin| kept[bin] && rows.usable[bin] && is_state(bin));
            median(used.map(|bin| residuals[joint][bin].powi(2)).collect()) / MEDIAN_OF_SQUARED_NORMAL
        };
        let torque = crate::rows::rms(&rows.tau[joint]);
        let floor = (own.min_model_error * torque).powi(2).max(f64::MIN_POSITIVE);
        let all = robust(&|_| true).max(floor);
        let level = |state: usize| robust(&|bin| states[bin] == state).max(own.min_variance_ratio * all);
        // Friction holds a robot at rest with any torque. Without drives, the torque is zero.
        let at_reversal = robust(&|bin| states[bin] == 0 && moving[bin]);
        let at_rest = robust(&|bin| states[bin] == 0 && !is_quiet[bin]);
        let near = at_reversal.max(at_rest).max(own.min_variance_ratio * all);
        let levels = [near, level(1), level(2)];
        let near_reversal = (own.friction_share * friction[joint]).powi(2);
        let last = rows.len() - 1;
        let predicted = |bin: usize| rows.tau[joint][bin] - residuals[joint][bin];
        let timing = |bin: usize| {
            let change = predicted((bin + 1).min(last)) - predicted(bin.saturating_sub(1));
            (own.time_error_s * change / (2.0 * rows.bin_s)).powi(2)
        };
        let of_friction = |bin: usize| {
            let of_load = (own.load_friction * predicted(bin)).powi(2);
            if states[bin] == 0 { near_reversal + of_load } else { 0.0 }
        };
        let of_bin = |bin: usize| levels[states[bin]] + timing(bin) + of_friction(bin);
        (0..rows.len()).map(of_bin).collect()
    };
    (0..rows.joints()).map(of_joint).collect()
}

/// State of motion in each bin: 0 near reversal or rest, 1 slow, 2 fast.
fn states(rows: &LogRows, joint: usize) -> Vec<usize> {
    let (own, dq) = (rows.settings.usual_residual, &rows.dq[joint]);
    let speeds: Vec<f64> = dq.iter().map(|speed| speed.abs()).collect();
    let slow = own.reversal_ratio * crate::rows::rms(dq);
    let moving = median(speeds.iter().copied().filter(|speed| *speed >= slow).collect());
    let mut states: Vec<usize> =
        speeds.iter().map(|&speed| if speed < slow { 0 } else { 1 + usize::from(speed > moving) }).collect();
    let near: Vec<usize> = (0..states.len()).filter(|&bin| states[bin] == 0).collect();
    for bin in near {
        let to = (bin + own.reversal_bins + 1).min(states.len());
        states[bin.saturating_sub(own.reversal_bins)..to].fill(0);
    }
    states
}
