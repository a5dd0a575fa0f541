//! Validation of limits.

use super::description::{BoxLimit, JointLimit, Limits};
use super::error::LimitError;
use super::kind::LimitKind;
use super::link_points::{LinkPoint, link_place};
use super::numbers::{finite, not_negative, positive};
use dynident_model::Model;
use dynident_model::terms::TorqueTerm;

impl Limits {
    /// Checks every number and name against the robot.
    ///
    /// # Errors
    /// The first contradiction: an unknown or duplicate joint, an unknown link, a value that is not finite or not
    /// positive, an empty or inverted range, a torque or power limit over bodies without inertial parameters, a box
    /// that is too small.
    pub fn validate(&self, model: &Model) -> Result<(), LimitError> {
        self.scale.validate()?;
        for (index, limit) in self.joints.iter().enumerate() {
            let joint = model.joint_index(&limit.joint).ok_or_else(|| LimitError::UnknownJoint {
                joint: limit.joint.clone(),
                known: model.joints().iter().map(|joint| joint.name.clone()).collect(),
            })?;
            if self.joints[..index].iter().any(|other| other.joint == limit.joint) {
                return Err(LimitError::DuplicateJoint { joint: limit.joint.clone() });
            }
            validate_joint(limit)?;
            for (kind, value) in [(LimitKind::Torque, limit.torque), (LimitKind::Power, limit.power_w)] {
                if value.is_some() {
                    prior_known(model, joint, kind)?;
                }
            }
        }
        for (index, limit) in self.boxes.iter().enumerate() {
            validate_box(limit, &format!("box {}", index + 1), model)?;
        }
        if let Some(floor) = &self.floor {
            finite("height of the floor", floor.height_m)?;
            validate_points(&floor.points, "the floor", model)?;
            floor.shapes.iter().try_for_each(|shape| shape.validate(model, "a shape above the floor"))?;
            for (link, lowered) in &floor.lowered_m {
                link_place(model, link, "the lowered floor")?;
                finite(&format!("lowered floor of link `{link}`"), *lowered)?;
            }
        }
        if let Some(column) = &self.column {
            positive("radius of the column", column.radius_m)?;
            if let Some(height) = column.height_m {
                finite("height of the column", height)?;
            }
            for value in column.axis_xy_m {
                finite("axis of the column", value)?;
            }
            if column.points.is_empty() {
                return Err(LimitError::NoPoints { what: "the column".to_owned() });
            }
            validate_points(&column.points, "the column", model)?;
        }
        let beyond = |(term, _): &&(TorqueTerm, f64)| term.joints().iter().any(|&joint| joint >= model.dof());
        if let Some((term, _)) = self.known_torque.terms().iter().find(beyond) {
            return Err(LimitError::TorqueOfNoJoint { term: term.symbol(), joints: model.dof() });
        }
        if let Some((term, value)) = self.known_torque.terms().iter().find(|(_, value)| !value.is_finite()) {
            return Err(LimitError::NotFinite { what: format!("known torque {}", term.symbol()), value: *value });
        }
        self.self_collision.as_ref().map_or(Ok(()), |limit| limit.validate(model))
    }
}

fn range(what: &str, range: [f64; 2]) -> Result<(), LimitError> {
    let [lower, upper] = range;
    finite(&format!("lower end of {what}"), lower)?;
    finite(&format!("upper end of {what}"), upper)?;
    if lower <= upper { Ok(()) } else { Err(LimitError::LowerAboveUpper { what: what.to_owned(), lower, upper }) }
}

fn validate_joint(limit: &JointLimit) -> Result<(), LimitError> {
    let name = &limit.joint;
    if let Some(position) = limit.position {
        range(&format!("position of joint `{name}`"), position)?;
        // The half width is a divisor, so the ends must differ by more than rounding.
        let (middle, half) = middle_and_half(position);
        if half <= 1e-12 * middle.abs().max(1.0) {
            return Err(LimitError::ZeroRange { joint: name.clone(), position: position[0] });
        }
    }
    let magnitudes = [
        ("speed", limit.speed),
        ("acceleration", limit.acceleration),
        ("jerk", limit.jerk),
        ("torque", limit.torque),
        ("power", limit.power_w),
    ];
    for (what, value) in magnitudes {
        if let Some(value) = value {
            positive(&format!("{what} limit of joint `{name}`"), value)?;
        }
    }
    let margin = limit.torque_margin;
    if !(0.0..1.0).contains(&margin) {
        let what = format!("torque margin of joint `{name}`");
        return Err(LimitError::OutOfRange { what, value: margin, at_least: 0.0, below: 1.0 });
    }
    Ok(())
}

pub(super) fn middle_and_half(range: [f64; 2]) -> (f64, f64) {
    let [lower, upper] = range;
    (0.5 * lower + 0.5 * upper, 0.5 * upper - 0.5 * lower)
}

fn prior_known(model: &Model, joint: usize, kind: LimitKind) -> Result<(), LimitError> {
    let carried = (0..model.body_count()).filter(|&body| model.moves(joint, body));
    let bodies: Vec<String> = carried
        .map(|body| &model.bodies()[body])
        .filter(|body| body.prior().is_none())
        .map(|body| format!("`{}`", body.name()))
        .collect();
    if bodies.is_empty() {
        return Ok(());
    }
    Err(LimitError::MissingPrior { joint: model.joints()[joint].name.clone(), kind, bodies })
}

fn validate_points(points: &[LinkPoint], what: &str, model: &Model) -> Result<(), LimitError> {
    for point in points {
        link_place(model, &point.link, what)?;
        for value in point.at_m {
            finite(&format!("a point of {what} on link `{}`", point.link), value)?;
        }
        not_negative(&format!("radius of a point of {what} on link `{}`", point.link), point.radius_m)?;
    }
    Ok(())
}

fn validate_box(limit: &BoxLimit, what: &str, model: &Model) -> Result<(), LimitError> {
    validate_points(&limit.points, what, model)?;
    let radius_m = limit.points.iter().fold(0.0, |largest, point| point.radius_m.max(largest));
    for (axis, ends) in [("x", limit.x_m), ("y", limit.y_m), ("z", limit.z_m)] {
        let Some(ends) = ends else { continue };
        let what = format!("{axis} of {what}");
        range(&what, ends)?;
        if middle_and_half(ends).1 <= radius_m {
            return Err(LimitError::NoRoom { what, lower: ends[0], upper: ends[1], radius_m });
        }
    }
    Ok(())
}
