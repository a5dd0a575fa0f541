//! Detection of jumps of a measured position that neither the motion nor the command explains.

use super::response::width;
use super::settings::CommandCheckSettings;
use super::{CommandFinding, JointMotion, median_step};
use core::f64::consts::TAU;

/// Number of sample steps before and after a jump that show the speed of the motion.
const NEARBY_STEPS: usize = 10;
/// Time before a jump in which a change of the command may have caused it, s.
const CAUSE_S: f64 = 1.0;
/// Minimum change of the command that explains a jump, as a share of the jump.
const MIN_CAUSE_SHARE: f64 = 0.5;
/// Maximum sum of a jump and the next step, as a share of the jump, for a single wrong sample. (Motion does not return
/// at once.)
const MAX_RETURN_SHARE: f64 = 0.5;
/// A time step that is longer than this number of median steps is a gap, during which the joint may have moved.
const MAX_GAP_STEPS: f64 = 3.0;
/// Assumed encoder count of a joint whose quantisation is unknown, rad or m.
const DEFAULT_COUNT: f64 = TAU / 4096.0;
/// Maximum difference of a jump from a whole turn, as a share of the turn.
const TURN_TOLERANCE: f64 = 0.05;

pub(super) fn jumps(
    joint: usize,
    own: &JointMotion,
    times_s: &[f64],
    settings: &CommandCheckSettings,
) -> Option<CommandFinding> {
    let step_s = median_step(times_s);
    let steps: Vec<f64> = own.positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let least = settings.min_jump_counts * own.count.unwrap_or(DEFAULT_COUNT);
    let cause = if step_s > 0.0 { (CAUSE_S / step_s).ceil() as usize } else { NEARBY_STEPS };
    let returns = |at: usize| match (steps.get(at), steps.get(at + 1)) {
        (Some(step), Some(next)) => (step + next).abs() < MAX_RETURN_SHARE * step.abs(),
        _ => false,
    };
    let is_jump = |&at: &usize| {
        let size = steps[at].abs();
        if size < least || times_s[at + 1] - times_s[at] > MAX_GAP_STEPS * step_s {
            return false;
        }
        // The step back from a single wrong sample is next to the jump, so it must not be used as motion nearby.
        let nearby = at.saturating_sub(NEARBY_STEPS)..(at + NEARBY_STEPS + 1).min(steps.len());
        let others = nearby.filter(|other| other.abs_diff(at) > 1).map(|other| steps[other].abs());
        // The step back from a single wrong sample belongs to the same jump.
        if at > 0 && returns(at - 1) && steps[at - 1].abs() >= least {
            return false;
        }
        let command = &own.commands[at.saturating_sub(cause)..=at + 1];
        size > settings.jump_step_ratio * others.fold(0.0, f64::max)
            && (returns(at) || width(command) < MIN_CAUSE_SHARE * size)
    };
    let found: Vec<usize> = (0..steps.len()).filter(is_jump).collect();
    let largest = found.iter().copied().max_by(|a, b| steps[*a].abs().total_cmp(&steps[*b].abs()))?;
    Some(CommandFinding::Jumps {
        joint,
        count: found.len(),
        time_s: times_s[largest + 1],
        size: steps[largest],
        is_turn: (steps[largest].abs() - TAU).abs() <= TURN_TOLERANCE * TAU,
    })
}
