//! `<axis>` of a joint.

use super::Version;
use super::fault::{SdfError, SdfFault, fault_at};
use super::frames::Frames;
use super::scopes::{Item, MODEL, full_name};
use super::values::{child, flag, number, number_of_any_size, numbers_in, required_text, word_of};
use crate::joint::{JointKind, JointLimits, JointSpring, Mimic};
use crate::spatial::Vec3;
use roxmltree::Node;

/// Limits of at least this magnitude mean "unlimited".
const UNLIMITED: f64 = 1e16;

pub(super) struct Axis {
    pub(super) kind: JointKind,
    /// Unit vector in the model's frame.
    pub(super) direction: Vec3,
    pub(super) limits: JointLimits,
    pub(super) damping: Option<f64>,
    pub(super) friction: Option<f64>,
    pub(super) spring: Option<JointSpring>,
    pub(super) mimic: Option<Mimic>,
}

pub(super) fn axis(joint: &Item<'_, '_>, slides: bool, version: Version, frames: &Frames) -> Result<Axis, SdfError> {
    let missing = || SdfFault::Missing { element: "joint".to_owned(), kind: "element", name: "axis" };
    let node = child(joint.node, "axis").ok_or_else(|| fault_at(joint.node, missing()))?;
    let mut found = Axis {
        kind: if slides { JointKind::Prismatic } else { JointKind::Continuous },
        direction: direction(joint, node, version, frames)?,
        limits: JointLimits::default(),
        damping: None,
        friction: None,
        spring: None,
        mimic: None,
    };
    if let Some(limit) = child(node, "limit") {
        let position = |name| -> Result<Option<f64>, SdfError> {
            Ok(number_of_any_size(limit, name)?.filter(|limit| limit.abs() < UNLIMITED))
        };
        // Negative rates and efforts mean "unlimited".
        let rate = |name| -> Result<Option<f64>, SdfError> {
            Ok(number_of_any_size(limit, name)?.filter(|limit| (0.0..UNLIMITED).contains(limit)))
        };
        found.limits = JointLimits {
            lower: position("lower")?,
            upper: position("upper")?,
            velocity: rate("velocity")?,
            effort: rate("effort")?,
        };
    }
    if !slides && (found.limits.lower.is_some() || found.limits.upper.is_some()) {
        found.kind = JointKind::Revolute;
    }
    if let Some(dynamics) = child(node, "dynamics") {
        found.damping = number(dynamics, "damping")?;
        found.friction = number(dynamics, "friction")?;
        let stiffness = number(dynamics, "spring_stiffness")?.filter(|stiffness| *stiffness != 0.0);
        let reference = number(dynamics, "spring_reference")?.unwrap_or(0.0);
        found.spring = stiffness.map(|stiffness| JointSpring { stiffness, reference });
    }
    found.mimic = child(node, "mimic").map(|mimic| followed(joint, mimic)).transpose()?;
    Ok(found)
}

/// Unit vector of the axis in the model's frame.
fn direction(joint: &Item<'_, '_>, node: Node<'_, '_>, version: Version, frames: &Frames) -> Result<Vec3, SdfError> {
    let xyz = child(node, "xyz");
    let written = xyz.map(numbers_in::<3>).transpose()?.map_or(Vec3([0.0, 0.0, 1.0]), Vec3);
    let norm = written.norm();
    // Vectors shorter than 1e-9 are rounding errors of zero.
    if norm < 1e-9 {
        return Err(fault_at(node, SdfFault::ZeroAxis { joint: joint.name.clone() }));
    }
    let unit = if norm == 1.0 { written } else { Vec3(written.0.map(|x| x / norm)) };
    let frame = if version >= Version([1, 7]) {
        xyz.and_then(|xyz| xyz.attribute("expressed_in")).filter(|frame| !frame.is_empty())
    } else {
        // Before version 1.5 axes are in the model's frame; in versions 1.5 and 1.6 only if the joint requests it.
        let is_models = version < Version([1, 5]) || flag(node, "use_parent_model_frame") == Some(true);
        is_models.then_some(MODEL)
    };
    let frame = frame.map_or_else(|| joint.name.clone(), |frame| full_name(&joint.scope, frame));
    let place = frames.of(&frame).ok_or_else(|| {
        fault_at(node, SdfFault::UnknownFrame { name: frame, of: format!("the axis of joint `{}`", joint.name) })
    })?;
    Ok(place.rotation.mul_vec(unit))
}

/// Mimic law `q = multiplier (q_leader − reference) + offset`.
fn followed(joint: &Item<'_, '_>, mimic: Node<'_, '_>) -> Result<Mimic, SdfError> {
    let source = match mimic.attribute("joint") {
        Some(_) => word_of(mimic, "joint")?,
        None => required_text(mimic, "joint")?,
    };
    let multiplier = number(mimic, "multiplier")?.unwrap_or(1.0);
    let reference = number(mimic, "reference")?.unwrap_or(0.0);
    let offset = number(mimic, "offset")?.unwrap_or(0.0) - multiplier * reference;
    Ok(Mimic::of(&full_name(&joint.scope, source), multiplier, offset))
}
