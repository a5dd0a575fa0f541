//! Writes a model from another format, such as a D-H table, as URDF.

use super::elements::UNKNOWN_POSITION;
use super::write::inertial_lines;
use crate::joint::{Joint, JointKind};
use crate::spatial::{Mat3, Transform};
use crate::tree::{Body, Model, STANDARD_GRAVITY};
use core::fmt::Write;
use dynident_text::xml::{comment, escaped};

/// Writes the model as URDF: links, joints with placement, axis, limits and friction, and the known inertials. Reading
/// the result gives the same model, except for these limitations of URDF: gravity is lost; a mimic joint with two
/// sources is described in a comment.
///
/// Unknown limits are written with a comment, because URDF readers use zero for missing limits. Unknown position
/// limits of a revolute or prismatic joint are written as ±1000 rad or m, which this crate's reader treats as unknown
/// again. An unknown velocity or effort is written as 0 where the format requires a value. A joint remains
/// `revolute`, because readers such as Pinocchio represent the position of a `continuous` joint by two numbers.
///
/// Angles are the fixed-axis roll, pitch and yaw of the placement, `R = Rz(yaw) Ry(pitch) Rx(roll)`, in rad.
pub fn write_urdf(model: &Model) -> String {
    let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(model.name()));
    if model.gravity() != STANDARD_GRAVITY {
        let [x, y, z] = model.gravity().0;
        let _ =
            writeln!(text, "  <!-- gravity in the base frame, which URDF does not support: {x:?} {y:?} {z:?} m/s² -->");
    }
    write_links(&mut text, model.base(), true);
    for (joint, body) in model.tree_joints().iter().zip(model.bodies()) {
        write_links(&mut text, body, false);
        let parent = joint.parent.map_or(model.base(), |parent| &model.bodies()[parent]);
        write_joint(&mut text, joint, parent.name(), body.name());
    }
    text + "</robot>\n"
}

/// Writes the links of a body; fixed joints connect the other links to the first one. The first link of the base
/// carries everything that is fixed.
fn write_links(text: &mut String, body: &Body, is_base: bool) {
    for (number, link) in body.links.iter().enumerate() {
        let name = escaped(&link.name);
        // Inertials that URDF cannot represent, such as moments without mass, are omitted.
        let inertial = link.inertial.filter(|_| !is_base);
        let lines = inertial.and_then(|inertial| inertial_lines(&link.name, &inertial, None).ok());
        let _ = match lines {
            Some(lines) => {
                let inside = lines.iter().map(|(depth, line)| format!("    {}{line}\n", "  ".repeat(*depth)));
                writeln!(text, "  <link name=\"{name}\">\n{}  </link>", inside.collect::<Vec<_>>().concat())
            }
            None => writeln!(text, "  <link name=\"{name}\"/>"),
        };
        if number > 0 {
            let _ = writeln!(
                text,
                "  <joint name=\"{name}_fixed\" type=\"fixed\">\n    {}\n    <parent link=\"{}\"/>\n    <child link=\"{name}\"/>\n  </joint>",
                origin(&link.placement),
                escaped(body.name())
            );
        }
    }
}

fn write_joint(text: &mut String, joint: &Joint, parent: &str, child: &str) {
    let limits = &joint.limits;
    let kind = joint.kind;
    let [x, y, z] = joint.axis.0;
    let _ = writeln!(
        text,
        "  <joint name=\"{}\" type=\"{}\">\n    {}\n    <parent link=\"{}\"/>\n    <child link=\"{}\"/>\n    <axis xyz=\"{x:?} {y:?} {z:?}\"/>",
        escaped(&joint.name),
        kind.name(),
        origin(&joint.placement),
        escaped(parent),
        escaped(child),
    );
    let needs_limit = kind != JointKind::Continuous || limits.velocity.is_some() || limits.effort.is_some();
    if needs_limit {
        let positions = [("lower", limits.lower), ("upper", limits.upper)];
        let positions = positions.iter().filter(|(_, value)| value.is_none() && kind != JointKind::Continuous);
        for (name, _) in positions {
            let _ = writeln!(text, "    <!-- ±{UNKNOWN_POSITION:?}: {name} not known -->");
        }
        let unknown = [("velocity", limits.velocity), ("effort", limits.effort)];
        let unknown: Vec<&str> = unknown.iter().filter(|(_, value)| value.is_none()).map(|(name, _)| *name).collect();
        if !unknown.is_empty() {
            let _ = writeln!(text, "    <!-- 0: {} not known -->", unknown.join(" and "));
        }
        let stops = if kind == JointKind::Continuous {
            String::new()
        } else {
            let [lower, upper] = [limits.lower.unwrap_or(-UNKNOWN_POSITION), limits.upper.unwrap_or(UNKNOWN_POSITION)];
            format!("lower=\"{lower:?}\" upper=\"{upper:?}\" ")
        };
        let _ = writeln!(
            text,
            "    <limit {stops}velocity=\"{:?}\" effort=\"{:?}\"/>",
            limits.velocity.unwrap_or(0.0),
            limits.effort.unwrap_or(0.0)
        );
    }
    let friction: Vec<String> = [("damping", joint.damping), ("friction", joint.friction)]
        .iter()
        .filter_map(|(name, value)| value.map(|value| format!(" {name}=\"{value:?}\"")))
        .collect();
    if !friction.is_empty() {
        let _ = writeln!(text, "    <dynamics{}/>", friction.concat());
    }
    match joint.mimic.as_ref().map(|mimic| (&mimic.sources[..], mimic.offset)) {
        None | Some(([], _)) => {}
        Some(([source], offset)) => {
            let name = escaped(&source.joint);
            let _ = writeln!(
                text,
                "    <mimic joint=\"{name}\" multiplier=\"{:?}\" offset=\"{offset:?}\"/>",
                source.multiplier
            );
        }
        Some((sources, offset)) => {
            let shares = sources.iter().map(|s| format!("{:?} {} + ", s.multiplier, s.joint));
            let law = comment(&format!("{}{offset:?}", shares.collect::<String>()));
            let _ = writeln!(text, "    <!-- follows {law}, which URDF does not support -->");
        }
    }
    *text += "  </joint>\n";
}

fn origin(placement: &Transform) -> String {
    let ([x, y, z], [roll, pitch, yaw]) = (placement.translation.0, roll_pitch_yaw(&placement.rotation));
    format!("<origin xyz=\"{x:?} {y:?} {z:?}\" rpy=\"{roll:?} {pitch:?} {yaw:?}\"/>")
}

/// Angles of [`Mat3::from_roll_pitch_yaw`]. At a pitch of ±90° only the sum of roll and yaw is defined, and roll is
/// set to zero.
fn roll_pitch_yaw(r: &Mat3) -> [f64; 3] {
    let r = &r.0;
    let level = r[0][0].hypot(r[1][0]);
    let pitch = (-r[2][0]).atan2(level);
    // Below this limit the sines of roll and yaw are rounding errors.
    if level < 1e-12 {
        return [0.0, pitch, (-r[0][1]).atan2(r[1][1])];
    }
    [r[2][1].atan2(r[2][2]), pitch, r[1][0].atan2(r[0][0])]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_give_the_rotation_back() {
        for roll in [-3.0, -1.2, 0.0, 0.4, 2.5] {
            for pitch in [-core::f64::consts::FRAC_PI_2, -1.0, 0.0, 0.7, core::f64::consts::FRAC_PI_2] {
                for yaw in [-2.9, 0.0, 1.1, core::f64::consts::PI] {
                    let given = Mat3::from_roll_pitch_yaw(roll, pitch, yaw);
                    let [roll, pitch, yaw] = roll_pitch_yaw(&given);
                    let back = Mat3::from_roll_pitch_yaw(roll, pitch, yaw) - given;
                    assert!(back.0.iter().flatten().all(|x| x.abs() < 1e-14));
                }
            }
        }
    }
}
