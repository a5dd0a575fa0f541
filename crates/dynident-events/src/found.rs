//! Converts the findings of the different searches to events.

use crate::classify::signature;
use crate::kind::{EventKind, LogEvent};
use crate::overflow::Overflow;
use crate::rows::LogRows;
use crate::scan::{Interval, Scan};
use crate::trend::Trend;
use dynident_dynamics::ParametricModel;

/// Event from an interval of the search for unexplained torque.
pub(crate) fn of_interval(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> LogEvent {
    let found = signature(rows, robot, scan, one);
    let [from_s, to_s] = found.times_s;
    let joint = one.strongest;
    let kept = || (0..rows.len()).filter(|&bin| scan.kept[bin] && rows.usable[bin]);
    let usual = kept().map(|bin| scan.residuals[joint][bin].powi(2)).sum::<f64>() / kept().count().max(1) as f64;
    let names = robot.joint_names();
    let named = |joints: &[usize]| joints.iter().map(|&joint| names[joint].clone()).collect();
    LogEvent {
        from_s,
        to_s,
        joints: named(&found.joints),
        kind: found.kind,
        alternative: found.alternative,
        clear: one.is_clear,
        set_aside: false,
        affected: named(&found.affected),
        unexplained_nm: one.excess[joint].max(0.0).sqrt(),
        usual_nm: usual.max(0.0).sqrt(),
        share: (to_s - from_s) / (rows.len() as f64 * rows.bin_s),
    }
}

/// Event for a hole in the log that was filled by straight lines. Exact straight lines are clear evidence.
pub(crate) fn of_filled_hole(rows: &LogRows, scan: &Scan, joints: &[String], [from_s, to_s]: [f64; 2]) -> LogEvent {
    let inside = |bin: &usize| (from_s..=to_s).contains(&rows.time_s[*bin]);
    let bins: Vec<usize> = (0..rows.len()).filter(inside).collect();
    let mean =
        |value: &dyn Fn(usize) -> f64| bins.iter().map(|&bin| value(bin)).sum::<f64>() / bins.len().max(1) as f64;
    let square = |joint: usize| mean(&|bin| scan.residuals[joint][bin].powi(2));
    let usual = |joint: usize| mean(&|bin| scan.variance[joint][bin]);
    let ratio = |joint: usize| square(joint) / usual(joint).max(f64::MIN_POSITIVE);
    let strongest = (0..rows.joints()).max_by(|a, b| ratio(*a).total_cmp(&ratio(*b))).unwrap_or(0);
    LogEvent {
        from_s,
        to_s,
        joints: joints.to_vec(),
        kind: EventKind::Interpolated,
        alternative: None,
        clear: true,
        set_aside: false,
        affected: joints.to_vec(),
        unexplained_nm: square(strongest).sqrt(),
        usual_nm: usual(strongest).sqrt(),
        share: (to_s - from_s) / (rows.len() as f64 * rows.bin_s),
    }
}

/// Event for one interval in which the torque number overflows.
pub(crate) fn of_overflow(
    one: &Overflow,
    [from_s, to_s]: [f64; 2],
    names: &[String],
    is_clear: bool,
    duration_s: f64,
) -> LogEvent {
    let joints = vec![names[one.joint].clone()];
    LogEvent {
        from_s,
        to_s,
        affected: joints.clone(),
        joints,
        kind: EventKind::Overflow,
        alternative: None,
        clear: is_clear,
        set_aside: false,
        unexplained_nm: one.jump_nm,
        usual_nm: one.usual_nm,
        share: (to_s - from_s) / duration_s,
    }
}

/// Event for a slow change of the torque, or for a sudden change of the offset. The event of a sudden change is the
/// shorter part of the log, before or after the change.
pub(crate) fn of_trend(rows: &LogRows, trend: &Trend, names: &[String]) -> LogEvent {
    let half = 0.5 * rows.bin_s;
    let (first_s, last_s) = ((rows.time_s[0] - half).max(0.0), rows.time_s[rows.len() - 1] + half);
    let duration_s = rows.len() as f64 * rows.bin_s;
    let [from_s, to_s] = match trend.step.map(|bin| rows.time_s[bin] - half) {
        Some(step_s) if step_s - first_s < last_s - step_s => [first_s, step_s],
        Some(step_s) => [step_s, last_s],
        None => [first_s, last_s],
    };
    let joints = vec![names[trend.joint].clone()];
    LogEvent {
        from_s,
        to_s,
        affected: joints.clone(),
        joints,
        kind: trend.kind,
        alternative: None,
        clear: trend.step.is_some() && (to_s - from_s) <= rows.settings.max_share * duration_s,
        set_aside: false,
        unexplained_nm: trend.size_nm,
        usual_nm: trend.left_nm,
        share: (to_s - from_s) / duration_s,
    }
}
