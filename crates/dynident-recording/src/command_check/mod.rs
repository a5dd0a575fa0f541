//! Checks a commanded motion for mistakes of the recording and of the study: exchanged columns, late commands, units,
//! signs, zeros, commands without effect, clamped commands, encoder jumps, invalid time stamps.

mod clamped;
mod finding;
mod jumps;
mod response;
mod settings;
#[cfg(test)]
mod tests;

pub use finding::{CommandFinding, Side, StampFault, UnitOf};
pub use settings::CommandCheckSettings;

use crate::commanded::CommandedMotion;
use response::{Response, median, range, width};

const DEGREE: f64 = core::f64::consts::PI / 180.0;
/// Smallest and largest ratio of position to command changes, relative to the factor of a unit, with which the motion
/// is treated as being in this unit. (Servos attenuate fast motion, down to 0.6 in the test recordings.)
const UNIT_RATIOS: [f64; 2] = [0.5, 1.3];
/// Ratio of a position to the limits of the robot description above which the position may be in degrees.
const MIN_LIMIT_RATIO: f64 = 4.0;
/// Margin beyond the limits of the robot description that a correct position may reach, in rad or m, and as a factor.
const LIMIT_MARGINS: [f64; 2] = [0.2, 1.2];
/// Minimum share of the joints that must show exchanged columns.
const MIN_EXCHANGED_SHARE: f64 = 0.66;
/// Minimum ratio of the residual variance without a lag to that with the lag, for the lag to show which channel follows
/// the other.
const MIN_LAG_GAIN: f64 = 1.2;

/// Samples of one joint, and its response.
struct JointMotion {
    positions: Vec<f64>,
    commands: Vec<f64>,
    response: Response,
    count: Option<f64>,
}

impl JointMotion {
    fn moves(&self, settings: &CommandCheckSettings) -> bool {
        width(&self.commands) >= settings.min_command_range && width(&self.positions) > 0.0
    }
}

/// Checks one log with commands. `limits` are the lowest and highest position of each joint in the robot description,
/// in the order of the log; empty if they are unknown.
///
/// For each joint, the position q is fitted by a linear function of an earlier command r, `q(t) ≈ a · r(t − lag) + b`.
/// Lag, slope a and correlation decide about exchanged columns, signs and units.
pub fn check_commands(
    motion: &CommandedMotion,
    limits: &[Option<[f64; 2]>],
    settings: &CommandCheckSettings,
) -> Vec<CommandFinding> {
    let step_s = median_step(&motion.times_s);
    let max_lag = if step_s > 0.0 { (settings.max_lag_s / step_s).round() as usize } else { 25 };
    let counts = motion.encoder_counts();
    let joints: Vec<JointMotion> = (0..motion.joints.len())
        .map(|joint| {
            let positions: Vec<f64> = motion.joint(&motion.positions, joint).collect();
            let commands: Vec<f64> = motion.joint(&motion.commands, joint).collect();
            let response = Response::of(&positions, &commands, max_lag);
            JointMotion { positions, commands, response, count: counts[joint] }
        })
        .collect();
    let mut found: Vec<CommandFinding> = stamps(&motion.times_s).into_iter().collect();
    if let Some(preceding) = preceding(motion, &joints, step_s, settings) {
        // Other comparisons of command and position have no meaning.
        found.push(preceding);
        return found;
    }
    let jumps = |(joint, own)| jumps::jumps(joint, own, &motion.times_s, settings);
    found.extend(joints.iter().enumerate().filter_map(jumps));
    // The position of a joint that jumps by a whole turn can only be compared after the jump is corrected.
    let is_turn = |finding: &CommandFinding| match finding {
        CommandFinding::Jumps { joint, is_turn: true, .. } => Some(*joint),
        _ => None,
    };
    let mut skipped: Vec<usize> = found.iter().filter_map(is_turn).collect();
    let (units, in_degrees) = degrees(&joints, limits, settings);
    found.extend(units);
    skipped.extend(in_degrees);
    for (joint, own) in joints.iter().enumerate().filter(|(joint, _)| !skipped.contains(joint)) {
        let response = own.response;
        if own.moves(settings) && response.correlation <= -settings.min_correlation {
            found.push(CommandFinding::Sign { joint, correlation: response.correlation });
        } else if let Some(no_effect) = no_effect(joint, &joints, max_lag, settings) {
            found.push(no_effect);
        } else {
            let clamped = clamped::clamped(joint, own, step_s, settings);
            if clamped.is_empty() && response.offset.abs() >= settings.min_offset {
                found.push(CommandFinding::Offset { joint, offset: response.offset });
            }
            found.extend(clamped);
        }
    }
    found
}

/// Median of the time steps that are not zero, s; 0 without any.
fn median_step(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    median(&mut steps).unwrap_or(0.0)
}

fn stamps(times_s: &[f64]) -> Option<CommandFinding> {
    let steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return None;
    }
    let changes: Vec<f64> = steps.iter().copied().filter(|step| *step != 0.0).collect();
    let fault = if changes.is_empty() {
        StampFault::Equal
    } else if 2 * changes.len() < steps.len() && changes.iter().all(|step| (step - step.round()).abs() < 1e-6) {
        StampFault::WholeSeconds
    } else {
        return None;
    };
    Some(CommandFinding::Stamps { fault })
}

/// The finding about positions that precede their commands: exchanged columns or late commands.
fn preceding(
    motion: &CommandedMotion,
    joints: &[JointMotion],
    step_s: f64,
    settings: &CommandCheckSettings,
) -> Option<CommandFinding> {
    let is_clear = |own: &JointMotion| {
        own.moves(settings)
            && own.response.correlation >= settings.min_correlation
            && own.response.lag != 0
            && own.response.lag_gain >= MIN_LAG_GAIN
    };
    let clear: Vec<usize> = (0..joints.len()).filter(|&joint| is_clear(&joints[joint])).collect();
    let negative: Vec<usize> = clear.iter().copied().filter(|&joint| joints[joint].response.lag < 0).collect();
    if negative.is_empty() || (negative.len() as f64) < MIN_EXCHANGED_SHARE * clear.len() as f64 {
        return None;
    }
    let mut lags: Vec<f64> = negative.iter().map(|&joint| -(joints[joint].response.lag as f64) * step_s).collect();
    let lag_s = median(&mut lags)?;
    // A measured position has the steps of its encoder, in its own column or in that of the command.
    let of_encoder =
        |commands: bool| negative.iter().filter(|&&joint| motion.are_commands_counted(joint) == Some(commands)).count();
    let joints = negative.len();
    Some(if of_encoder(false) > of_encoder(true) {
        CommandFinding::Late { lag_s, joints }
    } else {
        CommandFinding::Exchanged { lag_s, joints }
    })
}

/// Findings about degrees, and the joints with such values.
fn degrees(
    joints: &[JointMotion],
    limits: &[Option<[f64; 2]>],
    settings: &CommandCheckSettings,
) -> (Vec<CommandFinding>, Vec<usize>) {
    let ratio = |own: &JointMotion| own.response.slope.abs();
    let is_like = |own: &JointMotion, unit: f64| {
        let relative = ratio(own) / unit;
        // A command in degrees has a large range; a correct command next to it has a normal range.
        width(&own.commands) >= settings.min_command_range
            && own.response.correlation.abs() >= settings.min_correlation
            && (UNIT_RATIOS[0]..=UNIT_RATIOS[1]).contains(&relative)
    };
    let is_far_outside = |joint: usize, own: &JointMotion| {
        let Some(Some([low, high])) = limits.get(joint) else { return false };
        let limit = low.abs().max(high.abs());
        let [from, to] = range(&own.positions);
        let most = from.abs().max(to.abs());
        most > MIN_LIMIT_RATIO * limit && most * DEGREE <= LIMIT_MARGINS[1] * limit + LIMIT_MARGINS[0]
    };
    let (mut found, mut concerned) = (Vec::new(), Vec::new());
    for (of, unit) in [(UnitOf::Commands, Some(DEGREE)), (UnitOf::Positions, Some(1.0 / DEGREE)), (UnitOf::Both, None)]
    {
        let is_of = |&joint: &usize| match unit {
            Some(unit) => is_like(&joints[joint], unit),
            None => is_far_outside(joint, &joints[joint]) && is_like(&joints[joint], 1.0),
        };
        let those: Vec<usize> = (0..joints.len()).filter(is_of).collect();
        let mut ratios: Vec<f64> = those.iter().map(|&joint| ratio(&joints[joint])).collect();
        if let Some(ratio) = median(&mut ratios) {
            concerned.extend(&those);
            found.push(CommandFinding::Degrees { of, joints: those, ratio });
        }
    }
    (found, concerned)
}

fn no_effect(
    joint: usize,
    joints: &[JointMotion],
    max_lag: usize,
    settings: &CommandCheckSettings,
) -> Option<CommandFinding> {
    let own = &joints[joint];
    let [command_range, position_range] = [width(&own.commands), width(&own.positions)];
    if command_range < settings.min_command_range {
        return None;
    }
    let is_still = position_range < settings.min_effect_share * command_range;
    if !is_still && own.response.correlation.abs() >= settings.max_unrelated_correlation {
        return None;
    }
    let follows = |other: &usize| {
        let commands = &joints[*other].commands;
        let response = || Response::of(&own.positions, commands, max_lag);
        *other != joint
            && width(commands) >= settings.min_command_range
            && response().correlation >= settings.min_correlation
    };
    let follows = if is_still { None } else { (0..joints.len()).find(follows) };
    Some(CommandFinding::NoEffect { joint, command_range, position_range, follows })
}
