//! Writes identified values into an existing SDF.
//!
//! Only `<pose>`, `<mass>` and `<inertia>` in `<inertial>` of links and `<damping>` and `<friction>` of joints
//! change; all other bytes are kept. A link that is fixed to another link keeps its inertial, because SDF's default
//! is 1 kg. The link that carries it gets the remaining part of the identified inertial.

use super::fault::SdfError;
use super::frames::{Carrier, Frames, carrier};
use super::scopes::{Kind, Scopes, WORLD, full_name, scopes};
use super::values::{child, required_text};
use super::{model_of, read_sdf, version};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Transform, Vec3};
use crate::urdf::{JointChange, LinkChange, MAX_MAGNITUDE};
use crate::xml::MAX_NODES;
use crate::xml::edit::{Line, Source, edited};
use dynident_text::xml;
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashSet;
use std::ops::Range;
use thiserror::Error;

/// Why values could not be written into an SDF.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum SdfWriteError {
    /// The original is not readable.
    #[error("{0}")]
    Original(#[from] SdfError),
    /// The identified model has a link or joint that this SDF does not contain. Give the SDF from which the model was
    /// identified.
    #[error("the SDF has no {kind} `{name}`: write into the file that the model was read from")]
    Unknown { kind: &'static str, name: String },
    /// A program passed two sets of values for one link or joint. Correct the call.
    #[error("two changes to {kind} `{name}`: give one")]
    Repeated { kind: &'static str, name: String },
    /// A program asked to delete the `<inertial>` of this link. Simulators would then give the link a mass of 1 kg.
    #[error("link `{link}` needs an <inertial>, because SDF's default is 1 kg: keep it")]
    Removed { link: String },
    /// A value to write is NaN, infinite or too large. Identify the model again, or correct the values that the program
    /// passed.
    #[error("the new values of {kind} `{name}` are not all finite numbers below {MAX_MAGNITUDE:e}")]
    NotFinite { kind: &'static str, name: String },
    /// The values are those of an unconstrained estimate, with a negative mass or an impossible inertia. Write the
    /// physically consistent set, which is the default of `identify`.
    #[error(
        "the new values of link `{link}` are not physically consistent, and simulators would refuse them: use physically consistent parameters"
    )]
    NotPhysical { link: String },
}

/// Writes the changes into `original` and keeps all other bytes. The changes give inertials in the links' frames as
/// in [`read_sdf`]. They are written about the centre of mass in the axes of the `<link>`. Every number has the
/// shortest form that parses to the same `f64`. Drive inertia is ignored, because SDF has no element for it.
///
/// # Errors
/// An invalid SDF; an unknown or repeated link or joint; a removed inertial; or a link without physically consistent
/// parameters.
pub fn rewrite_sdf(original: &str, links: &[LinkChange], joints: &[JointChange]) -> Result<String, SdfWriteError> {
    read_sdf(original)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    // This cannot fail, because the same text has just been parsed.
    let Ok(document) = Document::parse_with_options(original, options) else { return Ok(original.to_owned()) };
    let root = document.root_element();
    let (_, model) = model_of(root)?;
    let found = scopes(model, version(root)?)?;
    let frames = Frames::new(&found)?;
    let source = Source::new(original);
    let mut edits = Vec::new();
    let mut seen = HashSet::new();
    for change in links {
        let (name, inertial, note) = match change {
            LinkChange::Set { link, inertial, note } => (link, inertial, note.as_deref()),
            LinkChange::Remove { link } => return Err(SdfWriteError::Removed { link: link.clone() }),
        };
        let index = named(&found, name, Kind::Link, "link")?;
        if !seen.insert(name) {
            return Err(SdfWriteError::Repeated { kind: "link", name: name.clone() });
        }
        let origin = moved_origin(&found, &frames, index)?;
        let link_from_moved = Transform { rotation: Mat3::IDENTITY, translation: origin };
        let own = if origin == Vec3::ZERO { *inertial } else { inertial.expressed_in(&link_from_moved) };
        write_inertial(&source, found.items[index].node, name, &own, note, &mut edits)?;
    }
    let mut seen = HashSet::new();
    for change in joints {
        let name = &change.joint;
        let index = named(&found, name, Kind::Joint, "joint")?;
        if !seen.insert(name) {
            return Err(SdfWriteError::Repeated { kind: "joint", name: name.clone() });
        }
        write_dynamics(&source, found.items[index].node, change, &mut edits)?;
    }
    Ok(edited(original, edits))
}

fn named(found: &Scopes<'_, '_>, name: &str, kind: Kind, word: &'static str) -> Result<usize, SdfWriteError> {
    let index = found.by_name.get(name).copied().filter(|&index| found.items[index].kind == kind);
    index.ok_or_else(|| SdfWriteError::Unknown { kind: word, name: name.to_owned() })
}

/// Origin of the link frame that the reader uses, in the SDF link: the position of the joint that moves the link.
fn moved_origin(found: &Scopes<'_, '_>, frames: &Frames, link: usize) -> Result<Vec3, SdfError> {
    let place = |name: &str| frames.of(name).unwrap_or(Transform::IDENTITY);
    for joint in found.items.iter().filter(|item| item.kind == Kind::Joint) {
        let is_fixed = joint.node.attribute("type") == Some("fixed");
        let written = required_text(joint.node, "child")?;
        let name = if written == WORLD { WORLD.to_owned() } else { full_name(&joint.scope, written) };
        if !is_fixed && carrier(found, &name) == Some(Carrier::Link(link)) {
            return Ok(place(&found.items[link].name).inverse().then(&place(&joint.name)).translation);
        }
    }
    Ok(Vec3::ZERO)
}

/// Writes the link's `<inertial>`; its other elements are kept.
fn write_inertial(
    source: &Source<'_>,
    node: Node<'_, '_>,
    link: &str,
    inertial: &InertialParameters,
    note: Option<&str>,
    edits: &mut Vec<(Range<usize>, String)>,
) -> Result<(), SdfWriteError> {
    if inertial.0.iter().any(|x| x.abs().is_nan() || x.abs() > MAX_MAGNITUDE) {
        return Err(SdfWriteError::NotFinite { kind: "link", name: link.to_owned() });
    }
    let (mass, com, inertia) =
        inertial.consistent_about_com().ok_or_else(|| SdfWriteError::NotPhysical { link: link.to_owned() })?;
    let ([x, y, z], i) = (com.0, inertia.0);
    let mut lines: Vec<Line> = vec![(0, "<inertial>".to_owned())];
    lines.extend(note.map(|note| (1, format!("<!-- {} -->", xml::comment(note)))));
    lines.push((1, format!("<pose>{x:?} {y:?} {z:?} 0 0 0</pose>")));
    lines.push((1, format!("<mass>{mass:?}</mass>")));
    lines.push((1, "<inertia>".to_owned()));
    let moments = [("ixx", i[0][0]), ("ixy", i[0][1]), ("ixz", i[0][2]), ("iyy", i[1][1]), ("iyz", i[1][2])];
    lines.extend(moments.into_iter().chain([("izz", i[2][2])]).map(|(name, x)| (2, format!("<{name}>{x:?}</{name}>"))));
    lines.push((1, "</inertia>".to_owned()));
    let old = child(node, "inertial");
    let others = old.into_iter().flat_map(|old| old.children().filter(Node::is_element));
    let others = others.filter(|other| !matches!(other.tag_name().name(), "pose" | "mass" | "inertia"));
    lines.extend(others.map(|other| (1, source.text[other.range()].to_owned())));
    lines.push((0, "</inertial>".to_owned()));
    edits.push(match old {
        Some(old) => source.replacement(old, &lines),
        None => source.insertion_at_start(node, &lines),
    });
    Ok(())
}

fn write_dynamics(
    source: &Source<'_>,
    node: Node<'_, '_>,
    change: &JointChange,
    edits: &mut Vec<(Range<usize>, String)>,
) -> Result<(), SdfWriteError> {
    let unknown = || SdfWriteError::Unknown { kind: "joint", name: change.joint.clone() };
    let axis = child(node, "axis").ok_or_else(unknown)?;
    let dynamics = child(axis, "dynamics");
    let mut new: Vec<Line> = Vec::new();
    let values = [("damping", change.damping), ("friction", change.friction), ("spring_stiffness", change.stiffness)];
    for (name, value) in values {
        let Some(value) = value else { continue };
        if !value.is_finite() {
            return Err(SdfWriteError::NotFinite { kind: "joint", name: change.joint.clone() });
        }
        let line = (0, format!("<{name}>{value:?}</{name}>"));
        match dynamics.and_then(|dynamics| child(dynamics, name)) {
            Some(old) => edits.push(source.replacement(old, &[line])),
            None => new.push(line),
        }
    }
    if new.is_empty() {
        return Ok(());
    }
    edits.push(if let Some(dynamics) = dynamics {
        source.insertion_at_start(dynamics, &new)
    } else {
        let inner = new.into_iter().map(|(depth, line)| (depth + 1, line));
        let all = [(0, "<dynamics>".to_owned())].into_iter().chain(inner).chain([(0, "</dynamics>".to_owned())]);
        source.insertion_at_start(axis, &all.collect::<Vec<_>>())
    });
    Ok(())
}
