//! Checks of the joints: limits, offsets, friction, mimic joints.

use super::AuditLevel::{Info, Problem, Warning};
use super::{AuditSettings, Findings, Lengths};
use crate::joint::{Joint, JointKind};
use crate::tree::Model;

pub(super) fn check(model: &Model, lengths: &Lengths, settings: &AuditSettings, findings: &mut Findings) {
    for joint in model.tree_joints() {
        let place = || format!("joint {}", joint.name);
        let offset = joint.placement.translation.norm();
        if offset > settings.max_joint_offset_m {
            let message =
                format!("is {offset:.4} m away from its parent joint: if that is millimetres, divide by 1000");
            findings.add(Problem, "length-unit", place(), message);
        }
        let follows = model.joint_index(&joint.name).is_none();
        check_limits(joint, follows, settings, findings);
        for (what, value) in [("damping", joint.damping), ("friction", joint.friction)] {
            if value.is_some_and(|value| value < 0.0) {
                let message = format!("has a negative {what}, which would drive the joint: fix the sign");
                findings.add(Problem, "friction-negative", place(), message);
            }
        }
        if let Some(mimic) = &joint.mimic {
            let rest = if follows {
                ": it is not a degree of freedom, and its load acts on these joints"
            } else {
                ", which is not a degree of freedom here, so that this joint is independent: lock the joint ([robot] lock) if the log does not contain its position"
            };
            findings.add(Info, "mimic", place(), format!("follows {}{rest}", mimic.source_names()));
        }
    }
    // If all joints have the same origin, there is no length for comparison.
    if lengths.reach > 0.0 && lengths.reach < 1e-3 {
        let message = format!("all joint origins lie within {:.2e} m: are lengths in kilometres?", lengths.reach);
        findings.add(Warning, "length-unit", "model".to_owned(), message);
    }
}

fn check_limits(joint: &Joint, follows: bool, settings: &AuditSettings, findings: &mut Findings) {
    let mut add = |level, check, message: String| findings.add(level, check, format!("joint {}", joint.name), message);
    let limits = &joint.limits;
    let is_rotary = joint.is_rotary();
    let unit = if is_rotary { "rad" } else { "m" };
    if joint.kind != JointKind::Continuous {
        match (limits.lower, limits.upper) {
            (Some(lower), Some(upper)) if lower > upper => {
                let has =
                    format!("has its lower limit {lower} {unit} above the upper limit {upper} {unit}: exchange them");
                add(Problem, "limit-order", has);
            }
            (Some(lower), Some(upper)) if lower == upper => {
                let cannot =
                    format!("cannot move: both limits are {lower} {unit}; correct the limits, or lock the joint");
                add(Warning, "limit-range", cannot);
            }
            (Some(_), Some(_)) => {}
            // The limits of a mimic joint follow from the limits of the joints that it follows.
            _ if follows => {}
            _ => {
                let has = "has no position limits: add them before `design`, to <limit> or to [design.limits]";
                add(Warning, "limit-missing", has.to_owned());
            }
        }
        let largest = limits.lower.into_iter().chain(limits.upper).map(f64::abs).fold(0.0, f64::max);
        if is_rotary && largest > settings.max_position_limit_rad {
            let has = format!("has a limit of {largest} rad: if that is degrees, write {:.6}", largest.to_radians());
            add(Warning, "limit-unit", has);
        }
        if !is_rotary && largest > settings.max_position_limit_m {
            let has = format!("has a limit of {largest} m: if that is millimetres, write {}", largest / 1000.0);
            add(Warning, "limit-unit", has);
        }
    }
    match limits.velocity {
        Some(velocity) if velocity <= 0.0 => {
            let has =
                format!("has a velocity limit of {velocity} {unit}/s, so that it cannot move: give the real limit");
            add(Warning, "velocity-limit", has);
        }
        Some(velocity) if is_rotary && velocity > settings.max_velocity_limit_rad_s => {
            let degrees = velocity.to_radians();
            let has = format!("has a velocity limit of {velocity} rad/s: if that is degrees, write {degrees:.6}");
            add(Warning, "limit-unit", has);
        }
        Some(_) => {}
        None if follows => {}
        None => {
            let has = "has no velocity limit: give one before designing an excitation";
            add(Info, "velocity-limit", has.to_owned());
        }
    }
    match limits.effort {
        // A mimic joint has no drive.
        _ if follows => {}
        Some(effort) if effort <= 0.0 => {
            let has = format!("has an effort limit of {effort}, so that it cannot move: give the real limit");
            add(Warning, "effort-limit", has);
        }
        Some(_) => {}
        None => {
            let has = "has no effort limit: saturated torque in a log cannot be detected with it";
            add(Info, "effort-limit", has.to_owned());
        }
    }
}
