//! Implausible motion: positions behind stops, velocities beyond limits, a recorder that is too slow or too fast.

use super::motion_rows::MotionRows;
use dynident_model::Model;
use dynident_recording::ImportReport;
use dynident_recording::log::Quantity;
use dynident_recording::report::ChannelReport;

/// Share of the range from which a position is behind its stop: zeros are calibrated to about a degree.
const POSITION_SHARE: f64 = 0.02;
/// Largest ratio of a velocity to its limit: descriptions state rated velocities.
const VELOCITY_TIMES: f64 = 1.5;
/// Rates that recorders of usual arms have, Hz; those of others have the same in their own seconds.
const RATES_HZ: [f64; 2] = [4.0, 50_000.0];

/// A joint beyond a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct BeyondLimit {
    /// The joint's number.
    pub joint: usize,
    /// `position` or `velocity`.
    pub quantity: &'static str,
    /// The value farthest beyond (SI).
    pub value: f64,
    /// The limit (SI).
    pub limit: f64,
}

/// All joints beyond their limits, at most one entry for each joint and quantity.
pub(super) fn beyond_limits(model: &Model, rows: &MotionRows) -> Vec<BeyondLimit> {
    let mut found = Vec::new();
    for (joint, description) in model.joints().iter().enumerate() {
        let limits = &description.limits;
        let [low, high] = extremes(&rows.q[joint]);
        let range = limits.upper.zip(limits.lower).map_or(0.0, |(upper, lower)| upper - lower);
        let tolerance = POSITION_SHARE * range;
        let over = limits.upper.filter(|&upper| high > upper + tolerance).map(|upper| (high, upper));
        let under = limits.lower.filter(|&lower| low < lower - tolerance).map(|lower| (low, lower));
        if let Some((value, limit)) = over.or(under).filter(|_| range > 0.0) {
            found.push(BeyondLimit { joint, quantity: "position", value, limit });
        }
        let [low, high] = extremes(&rows.dq[joint]);
        let fastest = if -low > high { low } else { high };
        if let Some(limit) = limits.velocity.filter(|&limit| limit > 0.0 && fastest.abs() > VELOCITY_TIMES * limit) {
            found.push(BeyondLimit { joint, quantity: "velocity", value: fastest, limit });
        }
    }
    found
}

/// Whether the channels of an import report show a position behind its stop, or a rate that no recorder has.
pub(crate) fn is_beyond_limits(model: &Model, report: &ImportReport) -> bool {
    let is_behind = |channel: &ChannelReport| {
        let limits = model.joint_index(&channel.joint).map(|joint| model.joints()[joint].limits);
        match limits.and_then(|limits| limits.lower.zip(limits.upper)) {
            Some((lower, upper)) if channel.channel == Quantity::Position && upper > lower => {
                let tolerance = POSITION_SHARE * (upper - lower);
                channel.max > upper + tolerance || channel.min < lower - tolerance
            }
            _ => false,
        }
    };
    !is_rate_of_a_recorder(model, report.rate_hz) || report.channels.iter().any(is_behind)
}

/// Whether a log has jumps that no motion makes, so that hypotheses are not comparable. Rejected single samples are no
/// jumps.
pub(crate) fn has_jumps(report: &ImportReport) -> bool {
    let is_measured = |channel: &&ChannelReport| matches!(channel.channel, Quantity::Position | Quantity::Torque);
    report.channels.iter().filter(is_measured).any(|channel| {
        channel.turns > 0 || channel.jumps > 0 || (channel.lone_samples > 0 && !report.sets_aside(channel))
    })
}

/// Whether a recorder of such a robot has this rate.
pub(super) fn is_rate_of_a_recorder(model: &Model, rate_hz: f64) -> bool {
    let [lowest, highest] = RATES_HZ.map(|usual_hz| model.own_scale().hertz(usual_hz));
    (lowest..=highest).contains(&rate_hz)
}

fn extremes(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}
