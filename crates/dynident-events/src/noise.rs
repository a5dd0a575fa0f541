//! Usual residual of each joint in each bin, as a function of the state of motion.

use crate::quiet::quiet;
use crate::rows::{LogRows, median};

/// Velocity below which a joint is treated as reversing or resting, relative to its root mean square velocity.
const REVERSAL_SHARE: f64 = 0.15;
/// Number of bins before and after a reversal that are treated as part of it.
const REVERSAL_BINS: usize = 3;
/// Share of the dry friction that may remain unexplained near reversal and at rest, where friction is not determined.
const FRICTION_SHARE: f64 = 0.5;
/// Assumed friction in proportion to the torque of the joint; the model does not contain such friction.
const LOAD_FRICTION: f64 = 0.08;
/// Assumed time difference between motion and torque after their filters, s.
const TIME_ERROR_S: f64 = 0.01;
/// Median of the square of a standard normal variable.
const MEDIAN_SQUARE: f64 = 0.4549;
/// Smallest residual variance for one state of motion, relative to the variance over all bins.
const MIN_LEVEL: f64 = 0.5;
/// Smallest usual residual relative to the joint's torque (both root mean square): model error that remains even with a
/// perfect sensor.
const MIN_MODEL_ERROR: f64 = 0.002;

/// Variance of each joint's residual in each bin. It is a robust variance over all bins in the same state of motion
/// (near reversal, slow, fast), plus a share of the dry friction near reversal.
pub(crate) fn usual_variance(rows: &LogRows, residuals: &[Vec<f64>], friction: &[f64], kept: &[bool]) -> Vec<Vec<f64>> {
    let moving: Vec<bool> = (0..rows.len()).map(|bin| rows.is_moving(bin)).collect();
    let is_quiet = quiet(rows);
    let of_joint = |joint: usize| -> Vec<f64> {
        let states = states(rows, joint);
        let robust = |is_state: &dyn Fn(usize) -> bool| {
            let used = (0..rows.len()).filter(|&bin| kept[bin] && rows.usable[bin] && is_state(bin));
            median(used.map(|bin| residuals[joint][bin].powi(2)).collect()) / MEDIAN_SQUARE
        };
        let torque = crate::rows::rms(&rows.tau[joint]);
        let floor = (MIN_MODEL_ERROR * torque).powi(2).max(f64::MIN_POSITIVE);
        let all = robust(&|_| true).max(floor);
        let level = |state: usize| robust(&|bin| states[bin] == state).max(MIN_LEVEL * all);
        // Friction holds a robot at rest with any torque. Without drives, the torque is zero.
        let at_reversal = robust(&|bin| states[bin] == 0 && moving[bin]);
        let at_rest = robust(&|bin| states[bin] == 0 && !is_quiet[bin]);
        let near = at_reversal.max(at_rest).max(MIN_LEVEL * all);
        let levels = [near, level(1), level(2)];
        let near_reversal = (FRICTION_SHARE * friction[joint]).powi(2);
        let last = rows.len() - 1;
        let predicted = |bin: usize| rows.tau[joint][bin] - residuals[joint][bin];
        let timing = |bin: usize| {
            let change = predicted((bin + 1).min(last)) - predicted(bin.saturating_sub(1));
            (TIME_ERROR_S * change / (2.0 * rows.bin_s)).powi(2)
        };
        let of_friction = |bin: usize| {
            let of_load = (LOAD_FRICTION * predicted(bin)).powi(2);
            if states[bin] == 0 { near_reversal + of_load } else { 0.0 }
        };
        let of_bin = |bin: usize| levels[states[bin]] + timing(bin) + of_friction(bin);
        (0..rows.len()).map(of_bin).collect()
    };
    (0..rows.joints()).map(of_joint).collect()
}

/// State of motion in each bin: 0 near reversal or rest, 1 slow, 2 fast.
fn states(rows: &LogRows, joint: usize) -> Vec<usize> {
    let dq = &rows.dq[joint];
    let speeds: Vec<f64> = dq.iter().map(|speed| speed.abs()).collect();
    let slow = REVERSAL_SHARE * crate::rows::rms(dq);
    let moving = median(speeds.iter().copied().filter(|speed| *speed >= slow).collect());
    let mut states: Vec<usize> =
        speeds.iter().map(|&speed| if speed < slow { 0 } else { 1 + usize::from(speed > moving) }).collect();
    let near: Vec<usize> = (0..states.len()).filter(|&bin| states[bin] == 0).collect();
    for bin in near {
        let to = (bin + REVERSAL_BINS + 1).min(states.len());
        states[bin.saturating_sub(REVERSAL_BINS)..to].fill(0);
    }
    states
}
