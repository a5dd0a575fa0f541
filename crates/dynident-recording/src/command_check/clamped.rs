//! Detection of commands beyond a limit at which the position remains.

use super::response::{range, width};
use super::settings::CommandCheckSettings;
use super::{CommandFinding, JointMotion, Side};

/// Tolerance around the limit, encoder counts.
const LIMIT_COUNTS: f64 = 3.0;
/// Tolerance around the limit, rad (m); the larger tolerance is used.
const LIMIT_TOLERANCE: f64 = 5e-3;
/// Minimum share of the time with a command beyond the limit during which the position is at the limit. (The position
/// needs some time to arrive.)
const MIN_SHARE_AT_LIMIT: f64 = 0.5;
/// Minimum ratio of the excess to the usual position error of the joint, for commands that are constant beyond the
/// limit.
const MIN_EXCESS_RATIO: f64 = 3.0;

/// Findings about the lower and the upper limit, if the servo clamps the command there.
pub(super) fn clamped(
    joint: usize,
    own: &JointMotion,
    step_s: f64,
    settings: &CommandCheckSettings,
) -> Vec<CommandFinding> {
    if !own.moves(settings) {
        return Vec::new();
    }
    let lag = own.response.lag.max(0) as usize;
    let pairs: Vec<(f64, f64)> = own.positions.iter().skip(lag).copied().zip(own.commands.iter().copied()).collect();
    let [low, high] = range(&own.positions);
    let tolerance = own.count.map_or(0.0, |count| LIMIT_COUNTS * count).max(LIMIT_TOLERANCE);
    let of_side = |(side, limit, sign): (Side, f64, f64)| {
        let excess = |command: f64| sign * (command - limit);
        let is_beyond = |pair: &&(f64, f64)| excess(pair.1) > 0.25 * settings.min_clamped_excess;
        let beyond: Vec<&(f64, f64)> = pairs.iter().filter(is_beyond).collect();
        let at_limit: Vec<f64> =
            beyond.iter().filter(|pair| (pair.0 - limit).abs() <= tolerance).map(|pair| pair.1).collect();
        let largest = beyond.iter().map(|pair| excess(pair.1)).fold(0.0, f64::max);
        let total_s = at_limit.len() as f64 * step_s;
        // Usual error of the joint: nine tenths of the other samples have a smaller error.
        let mut errors: Vec<f64> = pairs.iter().filter(|pair| !is_beyond(pair)).map(|(q, r)| (q - r).abs()).collect();
        let place = errors.len() * 9 / 10;
        let usual = if errors.is_empty() { 0.0 } else { *errors.select_nth_unstable_by(place, f64::total_cmp).1 };
        let is_clamped = largest >= settings.min_clamped_excess
            && total_s >= settings.min_clamped_s
            && at_limit.len() as f64 >= MIN_SHARE_AT_LIMIT * beyond.len() as f64
            // The command moves beyond the limit, or it is farther beyond it than usual errors of this joint.
            && (width(&at_limit) >= settings.min_clamped_excess || largest >= MIN_EXCESS_RATIO * usual);
        is_clamped.then_some(CommandFinding::Clamped { joint, side, limit, command: limit + sign * largest, total_s })
    };
    [(Side::Lower, low, -1.0), (Side::Upper, high, 1.0)].into_iter().filter_map(of_side).collect()
}
