//! Writes identified values into an existing MJCF.
//!
//! Only `<inertial>` of bodies and `damping`, `frictionloss` and `armature` of joints change. All other bytes are
//! kept, except invisible characters, which become character references ([`dynident_text::xml::document`]). A body
//! fixed to a moving body gets a massless `<inertial>`, because otherwise MuJoCo computes its mass from its geoms.

use super::compiler::FromGeoms;
use super::expanded::{Expanded, Include, Place};
use super::fault::MjcfError;
use super::tree::LinkPlace;
use super::{Found, read};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Transform, Vec3};
use crate::urdf::{JointChange, LinkChange, MAX_MAGNITUDE};
use crate::xml::MAX_NODES;
use crate::xml::edit::{Source, edited};
use core::fmt::Write;
use dynident_text::xml;
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use thiserror::Error;

/// Why values could not be written into an MJCF.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum MjcfWriteError {
    /// The original is not readable.
    #[error("{0}")]
    Original(#[from] MjcfError),
    /// The identified model has a body or joint that this MJCF does not contain. Give the MJCF from which the model was
    /// identified.
    #[error("the MJCF has no {kind} `{name}`: write into the file that the model was read from")]
    Unknown { kind: &'static str, name: String },
    /// A program passed two sets of values for one body or joint. Correct the call.
    #[error("two changes to {kind} `{name}`: give one")]
    Repeated { kind: &'static str, name: String },
    /// Dynident rewrites one file. Replace the `<include>` by the text of the included file, then run the command
    /// again.
    #[error("{kind} `{name}` is in an included file, which is not rewritten: put the robot into one file")]
    Included { kind: &'static str, name: String },
    /// A value to write is NaN, infinite or too large. Identify the model again, or correct the values that the program
    /// passed.
    #[error("the new values of {kind} `{name}` are not all finite numbers below {MAX_MAGNITUDE:e}")]
    NotFinite { kind: &'static str, name: String },
    /// The values are those of an unconstrained estimate, with a negative mass or an impossible inertia. Write the
    /// physically consistent set, which is the default of `identify`.
    #[error(
        "the new values of body `{body}` are not physically consistent, and MuJoCo would refuse them: use physically consistent parameters"
    )]
    NotPhysical { body: String },
    /// An MJCF body with two joints has one mass, behind the second joint. The identified model has mass between the
    /// two joints.
    #[error(
        "`{link}` is between two joints of one MJCF body and cannot have mass there: in the MJCF, give each joint its own body"
    )]
    Between { link: String },
    /// With this setting MuJoCo changes the masses when it loads the file, so that the written values would not be
    /// used.
    #[error("`{setting}` of <compiler> changes the masses that are written: {fix}")]
    Compiler { setting: &'static str, fix: &'static str },
}

/// Writes the changes into `original` and keeps all other bytes. The changes give inertials in the links' frames as
/// in [`read_mjcf`](super::read_mjcf). They are written about the centre of mass in the axes of the `<body>`. Every
/// number has the shortest form that parses to the same `f64`. `include` is used as in
/// [`read_mjcf_with`](super::read_mjcf_with).
///
/// # Errors
/// An invalid MJCF; a body or joint that is unknown, repeated or in an included file; or values that MuJoCo would
/// reject or change.
pub fn rewrite_mjcf(
    original: &str,
    include: &mut Include<'_>,
    links: &[LinkChange],
    joints: &[JointChange],
) -> Result<String, MjcfWriteError> {
    let document = Expanded::new(original, include)?;
    // The masses of the original are replaced.
    let found = read(&document, &mut |_: &str| Err(String::new()))?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    // This cannot fail, because the same text has just been parsed.
    let Ok(parsed) = Document::parse_with_options(original, options) else { return Ok(original.to_owned()) };
    let nodes: HashMap<usize, Node<'_, '_>> =
        parsed.descendants().filter(Node::is_element).map(|node| (node.range().start, node)).collect();
    let source = Source::new(original);
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let places: HashMap<&str, &LinkPlace> = found.links.iter().map(|link| (&*link.name, link)).collect();
    if !links.is_empty() {
        refuse_compiler(&found)?;
    }
    let mut seen = HashSet::new();
    for (link, change) in all_changes(&found, links) {
        let unknown = || MjcfWriteError::Unknown { kind: "body", name: link.to_owned() };
        let place = places.get(link).ok_or_else(unknown)?;
        if !seen.insert(link) {
            return Err(MjcfWriteError::Repeated { kind: "body", name: link.to_owned() });
        }
        let Some(body) = place.body else {
            match change {
                Some((inertial, _)) if inertial != InertialParameters::ZERO => {
                    return Err(MjcfWriteError::Between { link: link.to_owned() });
                }
                _ => continue,
            }
        };
        let node = node_at(&nodes, body, "body", link)?;
        let lines = match change {
            Some((inertial, note)) => {
                let body_from_link = Transform { rotation: Mat3::IDENTITY, translation: place.origin };
                let own = if place.origin == Vec3::ZERO { inertial } else { inertial.expressed_in(&body_from_link) };
                inertial_line(&found, link, &own, note)?
            }
            None => r#"<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>"#.to_owned(),
        };
        let lines = [(0, lines)];
        match inertial_of(node) {
            Some(old) if old.parent_element() == Some(node) => edits.push(source.replacement(old, &lines)),
            old => {
                edits.extend(old.map(|old| (source.with_own_line(old), String::new())));
                edits.push(source.insertion_at_start(node, &lines));
            }
        }
    }
    let mut seen = HashSet::new();
    for change in joints {
        let unknown = || MjcfWriteError::Unknown { kind: "joint", name: change.joint.clone() };
        let mut tree = found.model.tree_joints().iter();
        let index = tree.position(|joint| joint.name == change.joint).ok_or_else(unknown)?;
        if !seen.insert(&*change.joint) {
            return Err(MjcfWriteError::Repeated { kind: "joint", name: change.joint.clone() });
        }
        let node = node_at(&nodes, found.joint_places[index], "joint", &change.joint)?;
        drive(node, change, &mut edits)?;
    }
    Ok(edited(original, edits))
}

/// New inertial of a link with a note; the outer `None` is a link without mass.
type Change<'c> = Option<(InertialParameters, Option<&'c str>)>;

/// The requested changes and further changes that they require: a mesh body that is fixed to a changed body becomes
/// massless, because the changed body includes its mass.
fn all_changes<'c>(found: &'c Found, links: &'c [LinkChange]) -> Vec<(&'c str, Change<'c>)> {
    let mut all: Vec<(&str, Change<'_>)> = Vec::new();
    for change in links {
        match change {
            LinkChange::Set { link, inertial, note } => {
                all.push((link, Some((*inertial, note.as_deref()))));
                let body = found.model.bodies().iter().find(|body| body.name() == link);
                let fixed = body.into_iter().flat_map(|body| &body.links[1..]);
                let is_given = |name: &str| links.iter().any(|change| change.link() == name);
                let weighs = fixed.filter(|fixed| found.unknown.contains(&fixed.name) && !is_given(&fixed.name));
                all.extend(weighs.map(|fixed| (&*fixed.name, None)));
            }
            LinkChange::Remove { link } => all.push((link, None)),
        }
    }
    all
}

fn refuse_compiler(found: &Found) -> Result<(), MjcfWriteError> {
    let refused = |setting, fix| Err(MjcfWriteError::Compiler { setting, fix });
    if found.compiler.total_mass.is_some() {
        return refused("settotalmass", "delete it");
    }
    if found.compiler.from_geoms == FromGeoms::Always {
        return refused("inertiafromgeom", "write `auto`");
    }
    Ok(())
}

fn node_at<'a, 'input>(
    nodes: &HashMap<usize, Node<'a, 'input>>,
    place: Place,
    kind: &'static str,
    name: &str,
) -> Result<Node<'a, 'input>, MjcfWriteError> {
    let found = (place.source == 0).then(|| nodes.get(&place.at).copied()).flatten();
    found.ok_or_else(|| MjcfWriteError::Included { kind, name: name.to_owned() })
}

fn inertial_of<'a, 'input>(body: Node<'a, 'input>) -> Option<Node<'a, 'input>> {
    let mut ahead: Vec<Node<'a, 'input>> = body.children().collect();
    while let Some(node) = ahead.pop() {
        match node.tag_name().name() {
            "inertial" => return Some(node),
            "frame" => ahead.extend(node.children()),
            _ => {}
        }
    }
    None
}

fn inertial_line(
    found: &Found,
    body: &str,
    inertial: &InertialParameters,
    note: Option<&str>,
) -> Result<String, MjcfWriteError> {
    if inertial.0.iter().any(|x| x.abs().is_nan() || x.abs() > MAX_MAGNITUDE) {
        return Err(MjcfWriteError::NotFinite { kind: "body", name: body.to_owned() });
    }
    let (mass, com, inertia) =
        inertial.consistent_about_com().ok_or_else(|| MjcfWriteError::NotPhysical { body: body.to_owned() })?;
    let is_small = |[a, ..]: [f64; 3]| a < found.compiler.bound_inertia;
    let is_light = mass < found.compiler.bound_mass;
    if is_light || inertial.principal_moments().is_some_and(is_small) {
        let setting = if is_light { "boundmass" } else { "boundinertia" };
        return Err(MjcfWriteError::Compiler { setting, fix: "lower or delete it" });
    }
    let ([x, y, z], i) = (com.0, inertia.0);
    let tag = format!(
        r#"<inertial pos="{x:?} {y:?} {z:?}" mass="{mass:?}" fullinertia="{:?} {:?} {:?} {:?} {:?} {:?}""#,
        i[0][0], i[1][1], i[2][2], i[0][1], i[0][2], i[1][2]
    );
    Ok(match note {
        Some(note) => format!("{tag}><!-- {} --></inertial>", xml::comment(note)),
        None => format!("{tag}/>"),
    })
}

fn drive(
    node: Node<'_, '_>,
    change: &JointChange,
    edits: &mut Vec<(Range<usize>, String)>,
) -> Result<(), MjcfWriteError> {
    let values = [
        ("damping", change.damping),
        ("frictionloss", change.friction),
        ("armature", change.drive_inertia),
        ("stiffness", change.stiffness),
    ];
    let mut new = String::new();
    for (name, value) in values {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return Err(MjcfWriteError::NotFinite { kind: "joint", name: change.joint.clone() });
        }
        match node.attribute_node(name) {
            Some(old) => edits.push((old.range_value(), format!("{value:?}"))),
            None => drop(write!(new, " {name}=\"{value:?}\"")),
        }
    }
    if !new.is_empty() {
        let at = node.range().start + "<joint".len();
        edits.push((at..at, new));
    }
    Ok(())
}
