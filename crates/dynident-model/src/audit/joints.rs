//! Joints: limits, offsets, friction, followers.

use super::AuditLevel::{Info, Problem, Warning};
use super::{Findings, Lengths};
use crate::joint::{Joint, JointKind};
use crate::tree::Model;

/// No common robot has two joints further apart, m.
const LARGEST_OFFSET_M: f64 = 10.0;
/// Nearly five turns: more than any common multi-turn joint, far less than a half turn in degrees. rad.
const LARGEST_TURN_RAD: f64 = 30.0;
/// Longer than any common rail, m.
const LARGEST_STROKE_M: f64 = 100.0;
/// Faster than the joints of small legged robots by a factor of two, rad/s.
const LARGEST_REVOLUTE_VELOCITY_RAD_S: f64 = 100.0;

pub(super) fn check(model: &Model, lengths: &Lengths, findings: &mut Findings) {
    for joint in model.joints() {
        let place = || format!("joint {}", joint.name);
        let offset = joint.placement.translation.norm();
        if offset > LARGEST_OFFSET_M {
            findings.add(
                Problem,
                "length-unit",
                place(),
                format!("stands {offset:.4} m from its parent joint: if that is millimetres, divide by 1000"),
            );
        }
        limits(joint, findings);
        for (what, value) in [("damping", joint.damping), ("friction", joint.friction)] {
            if value.is_some_and(|value| value < 0.0) {
                findings.add(
                    Problem,
                    "friction-negative",
                    place(),
                    format!("has a negative {what}, which would drive the joint: fix the sign"),
                );
            }
        }
        if let Some(mimic) = &joint.mimic {
            let known = model.joint_index(&mimic.source).is_some();
            let rest = if known { "" } else { " (which does not move here)" };
            findings.add(
                Info,
                "mimic",
                place(),
                format!(
                    "mimics `{}`{rest}, but counts as a free joint here: lock it if the log does not hold it",
                    mimic.source
                ),
            );
        }
    }
    // All offsets in one point leave nothing to compare with, and no arm looks like that.
    if lengths.reach > 0.0 && lengths.reach < 1e-3 {
        findings.add(
            Warning,
            "length-unit",
            "model".to_owned(),
            format!("all joint origins lie within {:.2e} m: are lengths in kilometres?", lengths.reach),
        );
    }
}

fn limits(joint: &Joint, findings: &mut Findings) {
    let place = || format!("joint {}", joint.name);
    let limits = &joint.limits;
    let turns = joint.turns();
    let unit = if turns { "rad" } else { "m" };
    if joint.kind != JointKind::Continuous {
        match (limits.lower, limits.upper) {
            (Some(lower), Some(upper)) if lower > upper => findings.add(
                Problem,
                "limit-order",
                place(),
                format!("has its lower limit {lower} {unit} above the upper one {upper} {unit}: exchange them"),
            ),
            (Some(lower), Some(upper)) if lower == upper => findings.add(
                Warning,
                "limit-range",
                place(),
                format!("may not move: both limits are {lower} {unit}; give its range or lock it"),
            ),
            (Some(_), Some(_)) => {}
            _ => findings.add(
                Warning,
                "limit-missing",
                place(),
                "has no position limits: no excitation can be designed until they are given".to_owned(),
            ),
        }
        let largest = limits.lower.into_iter().chain(limits.upper).map(f64::abs).fold(0.0, f64::max);
        if turns && largest > LARGEST_TURN_RAD {
            findings.add(
                Warning,
                "limit-unit",
                place(),
                format!("has a limit of {largest} rad: if that is degrees, write {:.6}", largest.to_radians()),
            );
        }
        if !turns && largest > LARGEST_STROKE_M {
            findings.add(
                Warning,
                "limit-unit",
                place(),
                format!("has a limit of {largest} m: if that is millimetres, write {}", largest / 1000.0),
            );
        }
    }
    match limits.velocity {
        Some(velocity) if velocity <= 0.0 => findings.add(
            Warning,
            "velocity-limit",
            place(),
            format!("has a velocity limit of {velocity} {unit}/s, so that it may not move: give the real one"),
        ),
        Some(velocity) if turns && velocity > LARGEST_REVOLUTE_VELOCITY_RAD_S => findings.add(
            Warning,
            "limit-unit",
            place(),
            format!("has a velocity limit of {velocity} rad/s: if that is degrees, write {:.6}", velocity.to_radians()),
        ),
        Some(_) => {}
        None => findings.add(
            Info,
            "velocity-limit",
            place(),
            "has no velocity limit: give one before designing an excitation".to_owned(),
        ),
    }
    match limits.effort {
        Some(effort) if effort <= 0.0 => findings.add(
            Warning,
            "effort-limit",
            place(),
            format!("has an effort limit of {effort}, so that it could carry nothing: give the real one"),
        ),
        Some(_) => {}
        None => findings.add(
            Info,
            "effort-limit",
            place(),
            "has no effort limit: saturated torque in a log cannot be recognised by it".to_owned(),
        ),
    }
}
