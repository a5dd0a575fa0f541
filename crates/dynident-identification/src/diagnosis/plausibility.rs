//! Tests for implausible motion: positions beyond the joint limits, velocities beyond the limits, a rate that no
//! recorder has.

use super::motion_rows::MotionRows;
use crate::diagnosis_settings::MotionLimits;
use dynident_model::Model;
use dynident_recording::ImportReport;
use dynident_recording::log::Quantity;
use dynident_recording::report::ChannelReport;

/// A joint that exceeds a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct BeyondLimit {
    /// Index of the joint.
    pub joint: usize,
    /// `position` or `velocity`.
    pub quantity: &'static str,
    /// The value that exceeds the limit most (SI units).
    pub value: f64,
    /// The limit (SI units).
    pub limit: f64,
}

/// All joints beyond their limits, at most one entry for each joint and quantity.
pub(super) fn beyond_limits(model: &Model, rows: &MotionRows, settings: &MotionLimits) -> Vec<BeyondLimit> {
    let MotionLimits { max_overtravel, max_velocity_ratio, .. } = *settings;
    let mut found = Vec::new();
    for (joint, description) in model.joints().iter().enumerate() {
        let limits = &description.limits;
        let [low, high] = extremes(&rows.q[joint]);
        let range = limits.upper.zip(limits.lower).map_or(0.0, |(upper, lower)| upper - lower);
        let tolerance = max_overtravel * range;
        let over = limits.upper.filter(|&upper| high > upper + tolerance).map(|upper| (high, upper));
        let under = limits.lower.filter(|&lower| low < lower - tolerance).map(|lower| (low, lower));
        if let Some((value, limit)) = over.or(under).filter(|_| range > 0.0) {
            found.push(BeyondLimit { joint, quantity: "position", value, limit });
        }
        let [low, high] = extremes(&rows.dq[joint]);
        let fastest = if -low > high { low } else { high };
        let is_exceeded = |limit: &f64| *limit > 0.0 && fastest.abs() > max_velocity_ratio * limit;
        if let Some(limit) = limits.velocity.filter(is_exceeded) {
            found.push(BeyondLimit { joint, quantity: "velocity", value: fastest, limit });
        }
    }
    found
}

/// Whether an import report shows a position beyond its limit, or a rate that no recorder has.
pub(crate) fn is_beyond_limits(model: &Model, report: &ImportReport, settings: &MotionLimits) -> bool {
    let is_behind = |channel: &ChannelReport| {
        let limits = model.joint_index(&channel.joint).map(|joint| model.joints()[joint].limits);
        match limits.and_then(|limits| limits.lower.zip(limits.upper)) {
            Some((lower, upper)) if channel.channel == Quantity::Position && upper > lower => {
                let tolerance = settings.max_overtravel * (upper - lower);
                channel.max > upper + tolerance || channel.min < lower - tolerance
            }
            _ => false,
        }
    };
    !is_rate_of_a_recorder(model, report.rate_hz, settings) || report.channels.iter().any(is_behind)
}

/// Whether a log has jumps that are not motion, so that hypotheses cannot be compared. Single rejected samples are
/// harmless.
pub(crate) fn has_jumps(report: &ImportReport) -> bool {
    let is_measured = |channel: &&ChannelReport| matches!(channel.channel, Quantity::Position | Quantity::Torque);
    report.channels.iter().filter(is_measured).any(|channel| {
        channel.turns > 0 || channel.jumps > 0 || (channel.lone_samples > 0 && !report.sets_aside(channel))
    })
}

/// Whether recorders of robots of this size can have this rate.
pub(super) fn is_rate_of_a_recorder(model: &Model, rate_hz: f64, settings: &MotionLimits) -> bool {
    let [lowest, highest] = settings.recorder_rates_hz.map(|usual_hz| model.characteristic_scale().hertz(usual_hz));
    (lowest..=highest).contains(&rate_hz)
}

fn extremes(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}
