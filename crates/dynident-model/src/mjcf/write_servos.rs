//! Writes position actuators into an existing MJCF.

use super::write::MjcfWriteError;
use crate::xml::MAX_NODES;
use crate::xml::edit::{Source, edited};
use core::fmt::Write;
use dynident_text::xml;
use roxmltree::{Document, Node, ParsingOptions};
use std::ops::Range;

/// Position controller of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoChange {
    /// The joint.
    pub joint: String,
    /// Position gain, Nm/rad (N/m).
    pub stiffness: f64,
    /// Largest torque, Nm (N); `None` without limit.
    pub torque_limit: Option<f64>,
    /// Time from a command to its effect, s; zero means no delay.
    pub delay_s: f64,
}

/// Shortest time step of a simulation in which the complete delay is represented, s: MuJoCo keeps one command for
/// each step.
const DELAY_STEP_S: f64 = 0.000_25;

/// Constraint parameters with which a joint's friction hardly creeps: MuJoCo's largest impedance. With MuJoCo's
/// default, a joint at rest moves by some milliradians per second, and faster if its armature is small.
const STIFF_FRICTION: [(&str, &str); 2] =
    [("solreffriction", "0.005 1"), ("solimpfriction", "0.9999 0.9999 0.001 0.5 2")];

/// Writes gain, torque limit and delay into the `position` actuators of `original`, and adds an actuator for each
/// joint without one. The damping is written to the joint, whose friction constraint becomes stiff. All other bytes
/// are kept.
///
/// # Errors
/// Text that is not XML, or a value that is not a number.
pub fn rewrite_servos(original: &str, servos: &[ServoChange]) -> Result<String, MjcfWriteError> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    // The text was read as an MJCF before.
    let Ok(document) = Document::parse_with_options(original, options) else { return Ok(original.to_owned()) };
    let root = document.root_element();
    let actuators: Vec<Node<'_, '_>> = root
        .children()
        .filter(|section| section.has_tag_name("actuator"))
        .flat_map(|section| section.children().filter(|child| child.has_tag_name("position")))
        .collect();
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let mut added = Vec::new();
    for servo in servos {
        let finite = [servo.stiffness, servo.delay_s, servo.torque_limit.unwrap_or(0.0)];
        if finite.iter().any(|value| !value.is_finite()) {
            return Err(MjcfWriteError::NotFinite { kind: "joint", name: servo.joint.clone() });
        }
        let joint = root.descendants().find(|node| {
            node.has_tag_name("joint")
                && node.attribute("name") == Some(&servo.joint)
                && node.attribute("type") != Some("free")
        });
        if let Some(joint) = joint {
            let stiff = STIFF_FRICTION.map(|(name, value)| (name, Some(value.to_owned())));
            edit(joint, &stiff, &mut edits);
        }
        let values = attributes(servo);
        if let Some(node) = actuators.iter().find(|node| node.attribute("joint") == Some(&servo.joint)) {
            edit(*node, &values, &mut edits);
        } else {
            let mut line = format!(r#"<position joint="{}""#, xml::escaped(&servo.joint));
            for (name, value) in values.iter().filter_map(|(name, value)| Some((name, value.as_ref()?))) {
                let _ = write!(line, r#" {name}="{value}""#);
            }
            added.push((1, line + "/>"));
        }
    }
    if !added.is_empty() {
        added.insert(0, (0, "<actuator>".to_owned()));
        added.push((0, "</actuator>".to_owned()));
        edits.push(Source::new(original).insertion_at_start(root, &added));
    }
    Ok(edited(original, edits))
}

/// Attributes of the actuator; an attribute without a value is removed.
fn attributes(servo: &ServoChange) -> Vec<(&'static str, Option<String>)> {
    let samples = (servo.delay_s / DELAY_STEP_S).ceil().max(1.0);
    let is_late = servo.delay_s > 0.0;
    vec![
        ("kp", Some(format!("{:?}", servo.stiffness))),
        ("kv", Some("0".to_owned())),
        ("gear", Some("1".to_owned())),
        ("forcelimited", Some(servo.torque_limit.is_some().to_string())),
        ("forcerange", servo.torque_limit.map(|limit| format!("{:?} {limit:?}", -limit))),
        ("delay", is_late.then(|| format!("{:?}", servo.delay_s))),
        ("nsample", is_late.then(|| format!("{samples}"))),
    ]
}

fn edit(node: Node<'_, '_>, values: &[(&str, Option<String>)], edits: &mut Vec<(Range<usize>, String)>) {
    let mut new = String::new();
    for (name, value) in values {
        match (node.attribute_node(*name), value) {
            (Some(old), Some(value)) => edits.push((old.range_value(), value.clone())),
            (Some(old), None) => edits.push((old.range(), String::new())),
            (None, Some(value)) => drop(write!(new, r#" {name}="{value}""#)),
            (None, None) => {}
        }
    }
    let at = node.range().start + 1 + node.tag_name().name().len();
    edits.push((at..at, new));
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = r#"<mujoco>
  <worldbody>
    <body name="one"><joint name="a"/><geom size="0.1" mass="1"/>
      <body name="two"><joint name="b"/><geom size="0.1" mass="1"/></body>
    </body>
  </worldbody>
  <actuator>
    <position name="first" joint="a" kp="50" forcerange="-2 2"/>
  </actuator>
</mujoco>
"#;

    fn servo(joint: &str, torque_limit: Option<f64>, delay_s: f64) -> ServoChange {
        ServoChange { joint: joint.into(), stiffness: 12.5, torque_limit, delay_s }
    }

    #[test]
    fn an_actuator_gets_the_values_and_a_joint_without_one_gets_one() {
        let text = rewrite_servos(ARM, &[servo("a", None, 0.0), servo("b", Some(3.0), 0.01)]).unwrap();
        assert!(text.contains(r#"name="first" joint="a" kp="12.5" />"#), "{text}");
        assert!(text.contains(r#"<position kv="0" gear="1" forcelimited="false" name="first""#), "{text}");
        let added = r#"<position joint="b" kp="12.5" kv="0" gear="1" forcelimited="true" forcerange="-3.0 3.0" delay="0.01" nsample="40"/>"#;
        assert!(text.contains(added), "{text}");
        assert_eq!(text.matches("solreffriction").count(), 2);
        Document::parse(&text).unwrap();
    }

    #[test]
    fn a_value_that_is_no_number_is_refused() {
        let mut wrong = servo("a", None, 0.0);
        wrong.stiffness = f64::NAN;
        assert!(matches!(rewrite_servos(ARM, &[wrong]), Err(MjcfWriteError::NotFinite { .. })));
    }
}
