//! The elements `<link>` and `<joint>`, before the tree is built.

use super::collision;
use super::origin::origin;
use super::stated::stated_moments;
use super::values::{child, name, number, numbers, required_child, required_number};
use super::{MAX_MOVING_JOINTS, UrdfError, UrdfFault, UrdfRobot, fault_at};
use crate::collision::CollisionShape;
use crate::inertial::InertialParameters;
use crate::joint::{JointKind, JointLimits, Mimic};
use crate::spatial::{Mat3, Transform, Vec3};
use roxmltree::Node;
use std::collections::HashMap;

/// A position limit of this size, rad or m, or more is treated as unknown: no joint of a robot has such a range.
pub(super) const UNKNOWN_POSITION: f64 = 1.0e3;

pub(super) struct LinkElement<'a, 'input> {
    pub(super) node: Node<'a, 'input>,
    pub(super) name: &'a str,
    /// In the link's frame.
    pub(super) inertial: Option<InertialParameters>,
    /// In the link's frame.
    pub(super) collision: Vec<CollisionShape>,
}

pub(super) struct JointElement<'a, 'input> {
    pub(super) node: Node<'a, 'input>,
    pub(super) name: &'a str,
    /// `None` for a fixed joint.
    pub(super) kind: Option<JointKind>,
    pub(super) parent: &'a str,
    pub(super) child: &'a str,
    /// `parent_link_from_child_link` at position zero.
    pub(super) origin: Transform,
    pub(super) axis: Vec3,
    pub(super) limits: JointLimits,
    pub(super) damping: Option<f64>,
    pub(super) friction: Option<f64>,
    pub(super) mimic: Option<Mimic>,
}

/// Elements of URDF and its common extensions, by parent element.
const IN_LINK: [&str; 6] = ["inertial", "visual", "collision", "sensor", "contact", "gazebo"];
const IN_INERTIAL: [&str; 3] = ["origin", "mass", "inertia"];
const IN_JOINT: [&str; 10] =
    ["origin", "parent", "child", "axis", "calibration", "dynamics", "limit", "mimic", "safety_controller", "gazebo"];

/// Elements of which only the first is read.
const READ: [&str; 9] = ["origin", "mass", "inertia", "parent", "child", "axis", "limit", "dynamics", "mimic"];

type Unread<'a, 'input> = Vec<Node<'a, 'input>>;

pub(super) fn links<'a, 'input>(
    robot: Node<'a, 'input>,
    unread: &mut Unread<'a, 'input>,
) -> Result<Vec<LinkElement<'a, 'input>>, UrdfError> {
    let mut links = Vec::new();
    let mut seen = HashMap::new();
    for node in robot.children().filter(|node| node.has_tag_name("link")) {
        let name = name(node, "name")?;
        refuse_duplicate(&mut seen, "link", name, node)?;
        note_unread(node, &IN_LINK, unread);
        let inertial = match only_inertial(node, name)? {
            Some(element) => {
                note_unread(element, &IN_INERTIAL, unread);
                Some(inertial(element, name)?)
            }
            None => None,
        };
        let (collision, faulty) = collision::shapes(node);
        unread.extend(faulty.into_iter().take(UrdfRobot::MAX_UNREAD.saturating_sub(unread.len())));
        links.push(LinkElement { node, name, inertial, collision });
    }
    Ok(links)
}

pub(super) fn joints<'a, 'input>(
    robot: Node<'a, 'input>,
    unread: &mut Unread<'a, 'input>,
) -> Result<Vec<JointElement<'a, 'input>>, UrdfError> {
    let mut joints = Vec::new();
    let mut seen = HashMap::new();
    let mut moving = 0;
    for node in robot.children().filter(|node| node.has_tag_name("joint")) {
        let joint = joint(node)?;
        refuse_duplicate(&mut seen, "joint", joint.name, node)?;
        moving += usize::from(joint.kind.is_some());
        if moving > MAX_MOVING_JOINTS {
            return Err(fault_at(node, UrdfFault::TooManyJoints { limit: MAX_MOVING_JOINTS }));
        }
        note_unread(node, &IN_JOINT, unread);
        joints.push(joint);
    }
    Ok(joints)
}

fn joint<'a, 'input>(node: Node<'a, 'input>) -> Result<JointElement<'a, 'input>, UrdfError> {
    let joint = name(node, "name")?;
    let kind = match name(node, "type")? {
        "revolute" => Some(JointKind::Revolute),
        "continuous" => Some(JointKind::Continuous),
        "prismatic" => Some(JointKind::Prismatic),
        "fixed" => None,
        other => {
            let hint = match other {
                "floating" => "; a floating base is not supported, make the joint fixed",
                "planar" => "; write a planar joint as two prismatic joints and a revolute one",
                _ => "",
            };
            let fault = UrdfFault::JointType { joint: joint.to_owned(), kind: other.chars().take(40).collect(), hint };
            return Err(fault_at(node, fault));
        }
    };
    let parent = name(required_child(node, joint, "joint", "parent", "")?, "link")?;
    let child_link = name(required_child(node, joint, "joint", "child", "")?, "link")?;
    let origin = origin(node, || format!("joint `{joint}`"))?;
    let mut element = JointElement {
        node,
        name: joint,
        kind,
        parent,
        child: child_link,
        origin,
        axis: Vec3([1.0, 0.0, 0.0]),
        limits: JointLimits::default(),
        damping: None,
        friction: None,
        mimic: None,
    };
    let Some(kind) = kind else { return Ok(element) };
    if let Some(axis) = child(node, "axis") {
        let direction = Vec3(numbers(axis, "xyz")?.unwrap_or(element.axis.0));
        let norm = direction.norm();
        // Vectors shorter than 1e-9 are rounding errors of zero.
        if norm < 1e-9 {
            return Err(fault_at(axis, UrdfFault::ZeroAxis { joint: joint.to_owned() }));
        }
        // A division could change axes that are already exact.
        element.axis = if norm == 1.0 { direction } else { Vec3(direction.0.map(|x| x / norm)) };
    }
    if let Some(limit) = child(node, "limit") {
        element.limits =
            JointLimits { velocity: number(limit, "velocity")?, effort: number(limit, "effort")?, ..element.limits };
        let (lower, upper) = (number(limit, "lower")?, number(limit, "upper")?);
        if kind != JointKind::Continuous {
            let lower = lower.filter(|lower| *lower > -UNKNOWN_POSITION);
            let upper = upper.filter(|upper| *upper < UNKNOWN_POSITION);
            element.limits = JointLimits { lower, upper, ..element.limits };
        }
    }
    if let Some(dynamics) = child(node, "dynamics") {
        element.damping = numbers::<1>(dynamics, "damping")?.map(|[x]| x);
        element.friction = numbers::<1>(dynamics, "friction")?.map(|[x]| x);
    }
    if let Some(mimic) = child(node, "mimic") {
        element.mimic = Some(Mimic::of(
            name(mimic, "joint")?,
            numbers::<1>(mimic, "multiplier")?.map_or(1.0, |[x]| x),
            numbers::<1>(mimic, "offset")?.map_or(0.0, |[x]| x),
        ));
    }
    Ok(element)
}

/// `<inertial>`: mass, centre of mass, and inertia about the centre of mass in axes that the origin's rpy rotates.
fn inertial(node: Node<'_, '_>, link: &str) -> Result<InertialParameters, UrdfError> {
    const HINT: &str = ", or delete <inertial> so that the link is treated as unknown";
    let link_from_com = origin(node, || format!("the inertial of link `{link}`"))?;
    let mass = required_number(required_child(node, link, "inertial", "mass", HINT)?, "value")?;
    let element = required_child(node, link, "inertial", "inertia", HINT)?;
    let [xx, xy, xz, yy, yz, zz] = stated_moments(element)?;
    let at_com = Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
    let r = &link_from_com.rotation;
    // Without a rotation the numbers are not changed by rounding.
    let turned = if *r == Mat3::IDENTITY { at_com } else { r.mul_mat(&at_com).mul_mat(&r.transpose()) };
    Ok(InertialParameters::from_centre_of_mass(mass, link_from_com.translation, &turned))
}

fn refuse_duplicate<'a, 'input>(
    seen: &mut HashMap<&'a str, Node<'a, 'input>>,
    kind: &'static str,
    name: &'a str,
    node: Node<'a, 'input>,
) -> Result<(), UrdfError> {
    match seen.insert(name, node) {
        None => Ok(()),
        Some(first) => {
            let first_line = node.document().text_pos_at(first.range().start).row;
            Err(fault_at(node, UrdfFault::DuplicateName { kind, name: name.to_owned(), first_line }))
        }
    }
}

/// The `<inertial>` of a link. A second one is an error, because the choice would be ambiguous.
fn only_inertial<'a, 'input>(node: Node<'a, 'input>, link: &str) -> Result<Option<Node<'a, 'input>>, UrdfError> {
    let mut found = node.children().filter(|child| child.has_tag_name("inertial"));
    let first = found.next();
    match found.next() {
        Some(second) => Err(fault_at(second, UrdfFault::RepeatedInertial { link: link.to_owned() })),
        None => Ok(first),
    }
}

/// Notes child elements that are not in `known`, and repeated elements of which only the first is read.
fn note_unread<'a, 'input>(node: Node<'a, 'input>, known: &[&str], unread: &mut Unread<'a, 'input>) {
    let mut once = Vec::new();
    for child in node.children().filter(Node::is_element) {
        let element = child.tag_name().name();
        let repeated = READ.contains(&element) && once.contains(&element);
        if unread.len() < UrdfRobot::MAX_UNREAD && (repeated || !known.contains(&element)) {
            unread.push(child);
        }
        if READ.contains(&element) && !repeated {
            once.push(element);
        }
    }
}
