//! `<joint>`: hinges and slides of a body.

use super::classes::Stated;
use super::compiler::Compiler;
use super::expanded::Place;
use super::fault::{MjcfError, MjcfFault};
use super::notices::{MjcfLoss, Notices};
use crate::joint::{JointKind, JointLimits, JointSpring};
use crate::spatial::{Transform, Vec3};
use crate::xml::shortened;

/// A joint of a body, in the body's frame.
pub(super) struct JointElement {
    pub(super) name: Option<String>,
    pub(super) place: Place,
    pub(super) kind: JointKind,
    pub(super) axis: Vec3,
    /// A point on a hinge's axis; `None` for a slide.
    pub(super) anchor: Option<Vec3>,
    /// Position in the pose as drawn, rad or m.
    pub(super) reference: f64,
    pub(super) limits: JointLimits,
    pub(super) damping: Option<f64>,
    pub(super) friction: Option<f64>,
    pub(super) drive_inertia: Option<f64>,
    pub(super) spring: Option<JointSpring>,
}

/// Reads a joint; `body_from_frame` is the pose of the surrounding `<frame>`.
pub(super) fn joint(
    stated: &Stated<'_>,
    body_from_frame: &Transform,
    compiler: &Compiler,
    notices: &mut Notices,
) -> Result<JointElement, MjcfError> {
    let kind = stated.word("type", &["hinge", "slide", "ball", "free"], "hinge or slide")?.unwrap_or("hinge");
    let name = stated.get("name").map(|name| name.value.clone()).filter(|name| !name.trim().is_empty());
    let label = name.as_deref().map_or_else(|| "without a name".to_owned(), |name| format!("`{}`", shortened(name)));
    let is_rotary = match kind {
        "hinge" => true,
        "slide" => false,
        "ball" => {
            let what = format!("joint {label} of type ball");
            let fix = "write three hinges instead, or delete the joint so that the body is fixed";
            return Err(stated.fault(MjcfFault::Unsupported { what, fix }));
        }
        _ => return Err(stated.fault(nested_free_joint(&label))),
    };
    let angle = |value: f64| if is_rotary { compiler.radians(value) } else { value };
    let axis = stated.direction("axis")?.unwrap_or(Vec3([0.0, 0.0, 1.0]));
    let anchor = is_rotary.then_some(body_from_frame.point(stated.vector("pos")?.unwrap_or(Vec3::ZERO)));
    let range = stated.range("range")?;
    let is_limited = match stated.flag("limited")? {
        Some(is_limited) => is_limited && range.is_some(),
        None => compiler.autolimits && range.is_some_and(|[low, high]| low < high),
    };
    let stops = range.filter(|_| is_limited).map(|range| range.map(angle));
    let effort = effort(stated, notices, &label)?;
    let kind = match (is_rotary, stops) {
        (true, Some(_)) => JointKind::Revolute,
        (true, None) => JointKind::Continuous,
        (false, _) => JointKind::Prismatic,
    };
    let first = |name: &str| -> Result<(Option<f64>, bool), MjcfError> {
        let found = stated.numbers_of_any_size(name, 1, 10)?.unwrap_or_default();
        Ok((found.first().copied(), found.iter().skip(1).any(|&number| number != 0.0)))
    };
    let (damping, is_polynomial) = first("damping")?;
    if is_polynomial {
        notices.note(stated, MjcfLoss::DampingPolynomial { joint: label.clone() });
    }
    let (stiffness, is_polynomial) = first("stiffness")?;
    if is_polynomial {
        notices.note(stated, MjcfLoss::SpringPolynomial { joint: label });
    }
    let reference = angle(stated.number("springref")?.unwrap_or(0.0));
    let spring = stiffness.filter(|stiffness| *stiffness != 0.0);
    Ok(JointElement {
        name,
        place: stated.place,
        kind,
        axis: body_from_frame.rotation.mul_vec(axis),
        anchor,
        reference: angle(stated.number("ref")?.unwrap_or(0.0)),
        limits: JointLimits {
            lower: stops.map(|[low, _]| low),
            upper: stops.map(|[_, high]| high),
            velocity: None,
            effort,
        },
        damping,
        friction: stated.number("frictionloss")?,
        drive_inertia: stated.size("armature")?,
        spring: spring.map(|stiffness| JointSpring { stiffness, reference }),
    })
}

pub(super) fn nested_free_joint(label: &str) -> MjcfFault {
    MjcfFault::Unsupported {
        what: format!("joint {label} of type free in a body inside another body"),
        fix: "delete the joint, so that its body is fixed, or put the body directly into <worldbody>",
    }
}

/// `actuatorfrcrange`, if it is symmetric.
fn effort(stated: &Stated<'_>, notices: &mut Notices, label: &str) -> Result<Option<f64>, MjcfError> {
    let Some([low, high]) = stated.range("actuatorfrcrange")? else { return Ok(None) };
    if stated.flag("actuatorfrclimited")? == Some(false) || low >= high {
        return Ok(None);
    }
    if low == -high {
        return Ok(Some(high));
    }
    notices.note(stated, MjcfLoss::OneSidedEffort { joint: label.to_owned(), low, high });
    Ok(None)
}
