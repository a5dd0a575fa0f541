//! Writes identified values into an existing URDF.
//!
//! Only `<inertial>` and the two friction values of `<dynamics>` change. All other bytes are kept, except invisible
//! characters, which become character references ([`dynident_text::xml::document`]). A body consists of links that
//! are fixed to each other, and a log cannot distinguish these links. [`link_changes`] therefore assigns the inertial
//! of the whole body to the joint's child link, removes the `<inertial>` of the links fixed to it, and adds a
//! comment.

use super::prefixes::without_undeclared;
use super::{MAX_MAGNITUDE, UrdfError, parse};
use crate::inertial::InertialParameters;
use crate::tree::Model;
use crate::xml::edit::{Line, Source, edited};
use crate::xml::start_tag_length;
use dynident_text::xml;
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use thiserror::Error;

/// Change of one link's `<inertial>`.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkChange {
    /// Sets the parameters of a link.
    Set {
        /// Name of the link.
        link: String,
        /// New parameters in the link's frame.
        inertial: InertialParameters,
        /// A comment inside `<inertial>`.
        note: Option<String>,
    },
    /// Removes the `<inertial>` of a link, whose inertia is then unknown.
    Remove {
        /// Name of the link.
        link: String,
    },
}

impl LinkChange {
    pub(crate) fn link(&self) -> &str {
        match self {
            Self::Set { link, .. } | Self::Remove { link } => link,
        }
    }
}

/// New friction values of one joint; `None` keeps a value.
#[derive(Clone, Debug, PartialEq)]
pub struct JointChange {
    /// Name of the joint.
    pub joint: String,
    /// Viscous friction, Nm s/rad (N s/m).
    pub damping: Option<f64>,
    /// Coulomb friction, Nm (N).
    pub friction: Option<f64>,
    /// Drive inertia, kg m² (kg); only MJCF has it.
    pub drive_inertia: Option<f64>,
    /// Stiffness of the joint's spring, Nm/rad (N/m); only MJCF and SDF have it.
    pub stiffness: Option<f64>,
}

/// Why values could not be written into a URDF.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum UrdfWriteError {
    /// The original is not readable.
    #[error("{0}")]
    Original(#[from] UrdfError),
    /// The identified model has a link or joint that this URDF does not contain. Give the URDF from which the model was
    /// identified.
    #[error("the URDF has no {kind} `{name}`: write into the file that the model was read from")]
    Unknown { kind: &'static str, name: String },
    /// A program passed two sets of values for one link or joint. Correct the call.
    #[error("two changes to {kind} `{name}`: give one")]
    Repeated { kind: &'static str, name: String },
    /// A value to write is NaN or infinite. Identify the model again, or correct the values that the program passed.
    #[error("the new values of {kind} `{name}` are not all finite numbers")]
    NotFinite { kind: &'static str, name: String },
    /// The unconstrained estimate gives this link a moment but no mass. Write the physically consistent set, which is
    /// the default of `identify`.
    #[error("link `{link}` has moments but no mass, which URDF cannot express: use physically consistent parameters")]
    NoMass { link: String },
    /// A value is too large for any robot, usually because of a wrong unit. Check lengths and masses.
    #[error(
        "the new values of link `{link}` contain {value:e}, more than the limit of {MAX_MAGNITUDE:e}: check its lengths and masses"
    )]
    TooLarge { link: String, value: f64 },
    /// A program passed a list with the wrong number of parameter sets. Pass one set for each moving body.
    #[error("{found} parameter sets for {expected} moving bodies: give one for each")]
    Counts { expected: usize, found: usize },
}

/// Returns the changes that give every moving body of `model` the parameters `inertials` (body frames, one per
/// joint). The joint's child link gets all of them, and the links fixed to it lose their `<inertial>`. Reading the
/// result and merging the links gives exactly the new parameters.
///
/// # Errors
/// A different count.
pub fn link_changes(model: &Model, inertials: &[InertialParameters]) -> Result<Vec<LinkChange>, UrdfWriteError> {
    if inertials.len() != model.body_count() {
        return Err(UrdfWriteError::Counts { expected: model.body_count(), found: inertials.len() });
    }
    let mut changes = Vec::new();
    for (body, inertial) in model.bodies().iter().zip(inertials) {
        let fixed = &body.links[1..];
        let list = |known: bool| {
            let names: Vec<&str> =
                fixed.iter().filter(|link| link.inertial.is_some() == known).map(|link| link.name.as_str()).collect();
            names.join(", ")
        };
        let (known, unknown) = (list(true), list(false));
        let mut notes = Vec::new();
        if !known.is_empty() {
            notes.push(format!("includes the links fixed to this one, whose inertials were removed: {known}"));
        }
        if !unknown.is_empty() {
            notes.push(format!("includes fixed links that had no inertial: {unknown}"));
        }
        let note = (!notes.is_empty()).then(|| notes.join("; "));
        changes.push(LinkChange::Set { link: body.name().to_owned(), inertial: *inertial, note });
        changes.extend(
            fixed
                .iter()
                .filter(|link| link.inertial.is_some())
                .map(|link| LinkChange::Remove { link: link.name.clone() }),
        );
    }
    Ok(changes)
}

/// Writes the changes into `original` and keeps all other bytes. Inertia is written about the centre of mass in axes
/// parallel to those of the link (rpy = 0). Every number has the shortest form that parses to the same `f64`.
///
/// # Errors
/// An invalid URDF, an unknown or repeated link or joint, a value that is not finite, or moments without mass.
pub fn rewrite_urdf(original: &str, links: &[LinkChange], joints: &[JointChange]) -> Result<String, UrdfWriteError> {
    // The replaced text has the same length, so positions in it are valid in the original.
    let (regular, _) = without_undeclared(original);
    let document = parse(&regular)?;
    let robot = document.root_element();
    let source = Source::new(original);
    let mut nodes = HashMap::new();
    for node in robot.children().filter(Node::is_element) {
        if let Some(name) = node.attribute("name") {
            nodes.entry((node.tag_name().name(), name)).or_insert(node);
        }
    }
    let find = |kind: &'static str, name: &str| {
        nodes.get(&(kind, name)).copied().ok_or_else(|| UrdfWriteError::Unknown { kind, name: name.to_owned() })
    };

    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let mut seen = HashSet::new();
    for change in links {
        let node = find("link", change.link())?;
        if !seen.insert(("link", change.link())) {
            return Err(UrdfWriteError::Repeated { kind: "link", name: change.link().to_owned() });
        }
        let old = node.children().find(|child| child.has_tag_name("inertial"));
        match change {
            LinkChange::Set { link, inertial, note } => {
                let lines = inertial_lines(link, inertial, note.as_deref())?;
                edits.push(match old {
                    Some(old) => source.replacement(old, &lines),
                    None => source.insertion_at_start(node, &lines),
                });
            }
            LinkChange::Remove { .. } => edits.extend(old.map(|old| (source.with_own_line(old), String::new()))),
        }
    }
    for change in joints {
        let node = find("joint", &change.joint)?;
        if !seen.insert(("joint", &change.joint)) {
            return Err(UrdfWriteError::Repeated { kind: "joint", name: change.joint.clone() });
        }
        friction(&source, node, change, &mut edits)?;
    }

    Ok(edited(original, edits))
}

/// Lines of an `<inertial>` about the centre of mass, in axes parallel to those of the link.
pub(super) fn inertial_lines(
    link: &str,
    inertial: &InertialParameters,
    note: Option<&str>,
) -> Result<Vec<Line>, UrdfWriteError> {
    if inertial.0.iter().any(|x| !x.is_finite()) {
        return Err(UrdfWriteError::NotFinite { kind: "link", name: link.to_owned() });
    }
    let (com, inertia) = match (inertial.com_m(), inertial.inertia_at_com()) {
        (Some(com), Some(inertia)) => (com, inertia),
        _ if *inertial == InertialParameters::ZERO => (crate::Vec3::ZERO, crate::Mat3::ZERO),
        _ => return Err(UrdfWriteError::NoMass { link: link.to_owned() }),
    };
    if com.0.iter().chain(inertia.0.iter().flatten()).any(|x| !x.is_finite()) {
        return Err(UrdfWriteError::NoMass { link: link.to_owned() });
    }
    let largest = com
        .0
        .iter()
        .chain(inertia.0.iter().flatten())
        .fold(inertial.mass_kg(), |a, b| if b.abs() > a.abs() { *b } else { a });
    if largest.abs() > MAX_MAGNITUDE {
        return Err(UrdfWriteError::TooLarge { link: link.to_owned(), value: largest });
    }
    let ([x, y, z], i) = (com.0, inertia.0);
    let mut lines = vec![(0, "<inertial>".to_owned())];
    lines.extend(note.map(|note| (1, format!("<!-- {} -->", xml::comment(note)))));
    lines.push((1, format!(r#"<origin xyz="{x:?} {y:?} {z:?}" rpy="0 0 0"/>"#)));
    lines.push((1, format!(r#"<mass value="{:?}"/>"#, inertial.mass_kg())));
    lines.push((
        1,
        format!(
            r#"<inertia ixx="{:?}" ixy="{:?}" ixz="{:?}" iyy="{:?}" iyz="{:?}" izz="{:?}"/>"#,
            i[0][0], i[0][1], i[0][2], i[1][1], i[1][2], i[2][2]
        ),
    ));
    lines.push((0, "</inertial>".to_owned()));
    Ok(lines)
}

/// Writes the two friction values of one joint into its `<dynamics>`, or into a new `<dynamics>`.
fn friction(
    source: &Source<'_>,
    joint: Node<'_, '_>,
    change: &JointChange,
    edits: &mut Vec<(Range<usize>, String)>,
) -> Result<(), UrdfWriteError> {
    let values = [("damping", change.damping), ("friction", change.friction)];
    let values: Vec<(&str, f64)> = values.iter().filter_map(|&(name, value)| Some((name, value?))).collect();
    if values.iter().any(|(_, value)| !value.is_finite()) {
        return Err(UrdfWriteError::NotFinite { kind: "joint", name: change.joint.clone() });
    }
    if values.is_empty() {
        return Ok(());
    }
    let as_attributes = |values: &[(&str, f64)]| -> String {
        values.iter().flat_map(|(name, value)| [" ".to_owned(), format!(r#"{name}="{value:?}""#)]).collect()
    };
    if let Some(dynamics) = joint.children().find(|child| child.has_tag_name("dynamics")) {
        let (old, new): (Vec<_>, Vec<_>) =
            values.into_iter().partition(|(name, _)| dynamics.attribute_node(*name).is_some());
        for (name, value) in old {
            edits.extend(dynamics.attribute_node(name).map(|old| (old.range_value(), format!("{value:?}"))));
        }
        if !new.is_empty() {
            let at = dynamics.range().start + "<dynamics".len();
            edits.push((at..at, as_attributes(&new)));
        }
        return Ok(());
    }
    let new = format!("<dynamics{}/>", as_attributes(&values));
    if let Some(last) = joint.children().rfind(Node::is_element) {
        let at = last.range().end;
        let lead = source.indentation(last.range().start).map(|own| format!("{}{own}", source.eol)).unwrap_or_default();
        edits.push((at..at, lead + &new));
        return Ok(());
    }
    let start = joint.range().start;
    let tag_end = start + start_tag_length(&source.text[joint.range()]);
    edits.push(if source.text[..tag_end].ends_with("/>") {
        (tag_end - 2..tag_end, format!(">{new}</joint>"))
    } else {
        (tag_end..tag_end, new)
    });
    Ok(())
}
