//! Writing identified values back into the user's own URDF.
//!
//! Only `<inertial>` and the two friction values of `<dynamics>` change; every other byte stays, with its comments,
//! order, spacing and line ends. A body is lumped from links that are fixed to each other, and a log cannot distinguish
//! them: [`link_changes`] gives the whole body to the joint's own link, takes the `<inertial>` from the links fixed to
//! it, and says so in a comment.

use super::prefixes::without_undeclared;
use super::{MAX_MAGNITUDE, UrdfError, parse};
use crate::inertial::InertialParameters;
use crate::tree::Model;
use roxmltree::Node;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use thiserror::Error;

/// What becomes of one link's `<inertial>`.
#[derive(Clone, Debug, PartialEq)]
pub enum LinkChange {
    /// The link gets these parameters.
    Set {
        /// Name of the link.
        link: String,
        /// New parameters in the link's frame.
        inertial: InertialParameters,
        /// A comment inside `<inertial>`.
        note: Option<String>,
    },
    /// The link loses its `<inertial>`: it becomes unknown.
    Remove {
        /// Name of the link.
        link: String,
    },
}

impl LinkChange {
    fn link(&self) -> &str {
        match self {
            Self::Set { link, .. } | Self::Remove { link } => link,
        }
    }
}

/// New friction values of one joint; what is `None` stays as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct JointChange {
    /// Name of the joint.
    pub joint: String,
    /// Viscous friction, Nm s/rad (N s/m).
    pub damping: Option<f64>,
    /// Coulomb friction, Nm (N).
    pub friction: Option<f64>,
}

/// Why a URDF could not be rewritten.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum UrdfWriteError {
    /// The original is not readable.
    #[error(transparent)]
    Original(#[from] UrdfError),
    /// A change to something that the original does not hold.
    #[error("the URDF has no {kind} `{name}`: write into the file that the model was read from")]
    Unknown {
        /// `link` or `joint`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// Two changes to one link or joint.
    #[error("two changes to {kind} `{name}`: give one")]
    Repeated {
        /// `link` or `joint`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A value that is not finite.
    #[error("the new values of {kind} `{name}` are not all finite numbers")]
    NotFinite {
        /// `link` or `joint`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// Moments without mass have no centre of mass, and URDF has no other way to say them.
    #[error("link `{link}` has moments but no mass, which URDF cannot express: use physically consistent parameters")]
    NoMass {
        /// The link.
        link: String,
    },
    /// A value that no reader would take.
    #[error(
        "the new values of link `{link}` hold {value:e}, beyond the {MAX_MAGNITUDE:e} that a description may hold: check its lengths and masses"
    )]
    TooLarge {
        /// The link.
        link: String,
        /// The value.
        value: f64,
    },
    /// As many parameter sets as moving bodies are needed.
    #[error("{found} parameter sets for {expected} moving bodies")]
    Counts {
        /// Number of moving bodies.
        expected: usize,
        /// Number of parameter sets.
        found: usize,
    },
}

/// The changes that give every moving body of `model` the parameters `inertials` (body frames, one per joint): the
/// joint's own link gets them whole, the links fixed to it lose their `<inertial>`. Reading and lumping the result
/// gives exactly the new parameters.
///
/// # Errors
/// If the count differs.
pub fn link_changes(model: &Model, inertials: &[InertialParameters]) -> Result<Vec<LinkChange>, UrdfWriteError> {
    if inertials.len() != model.dof() {
        return Err(UrdfWriteError::Counts { expected: model.dof(), found: inertials.len() });
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

/// `original` with the changes made and every other byte as it was. Inertia is written about the centre of mass in axes
/// parallel to the link's (rpy = 0), every number in the shortest form that reads back to the same `f64`.
///
/// # Errors
/// If the original is no URDF, a link or joint is unknown or named twice, a value is not finite, or a link has moments
/// without mass.
pub fn rewrite_urdf(original: &str, links: &[LinkChange], joints: &[JointChange]) -> Result<String, UrdfWriteError> {
    // Of the same length, so that its places are the original's.
    let (regular, _) = without_undeclared(original);
    let document = parse(&regular)?;
    let robot = document.root_element();
    let source = Source { text: original, eol: if original.contains("\r\n") { "\r\n" } else { "\n" } };
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
        source.friction(node, change, &mut edits)?;
    }

    Ok(edited(original, edits))
}

/// `original` with pieces of it replaced; the pieces do not overlap, every other byte stays.
pub(super) fn edited(original: &str, mut edits: Vec<(Range<usize>, String)>) -> String {
    edits.sort_by_key(|(range, _)| range.start);
    let mut text = String::with_capacity(original.len() + edits.iter().map(|(_, new)| new.len()).sum::<usize>());
    let mut done = 0;
    for (range, new) in edits {
        text += &original[done..range.start];
        text += &new;
        done = range.end;
    }
    text += &original[done..];
    text
}

/// A line of a new element, with its depth below the element's own indentation.
type Line = (usize, String);

/// An `<inertial>` about the centre of mass, in axes parallel to the link's.
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
    lines.extend(note.map(|note| (1, format!("<!-- {} -->", comment_text(note)))));
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

/// XML allows neither two hyphens in a row nor control characters in a comment.
fn comment_text(note: &str) -> String {
    let mut text = String::with_capacity(note.len());
    for c in note.chars() {
        if c == '-' && text.ends_with('-') {
            text.push(' ');
        }
        text.push(if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { ' ' } else { c });
    }
    text
}

/// The original text and how it breaks lines.
struct Source<'a> {
    text: &'a str,
    eol: &'a str,
}

impl Source<'_> {
    /// The white space before `at` on its line; `None` if something else stands there.
    fn indentation(&self, at: usize) -> Option<&str> {
        let start = self.text[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let prefix = &self.text[start..at];
        prefix.chars().all(|c| c == ' ' || c == '\t').then_some(prefix)
    }

    /// By how much the children of `node` stand further in than `node`.
    fn step(&self, node: Node<'_, '_>) -> String {
        let own = self.indentation(node.range().start).unwrap_or("");
        let child = node.children().find(Node::is_element).and_then(|child| self.indentation(child.range().start));
        match child.and_then(|child| child.strip_prefix(own)) {
            Some(step) if !step.is_empty() => step.to_owned(),
            // Links are children of the root, so that their own indentation is one step.
            _ if !own.is_empty() && node.parent_element().is_some_and(|parent| parent.has_tag_name("robot")) => {
                own.to_owned()
            }
            _ => "  ".to_owned(),
        }
    }

    fn joined(&self, lines: &[Line], indentation: &str, step: &str) -> String {
        let separator = format!("{}{indentation}", self.eol);
        let lines: Vec<String> = lines.iter().map(|(depth, line)| step.repeat(*depth) + line).collect();
        lines.join(&separator)
    }

    fn compact(lines: &[Line]) -> String {
        lines.iter().map(|(_, line)| line.as_str()).collect()
    }

    /// The new element in the old one's place; on one line if the old one was.
    fn replacement(&self, old: Node<'_, '_>, lines: &[Line]) -> (Range<usize>, String) {
        let range = old.range();
        let new = match self.indentation(range.start) {
            Some(indentation) if self.text[range.clone()].contains('\n') => {
                self.joined(lines, indentation, &self.step(old))
            }
            _ => Self::compact(lines),
        };
        (range, new)
    }

    /// The new element as the first child of `node`.
    fn insertion_at_start(&self, node: Node<'_, '_>, lines: &[Line]) -> (Range<usize>, String) {
        let range = node.range();
        let tag = &self.text[range.clone()];
        let tag_end = range.start + start_tag_length(tag);
        let empty = self.text[..tag_end].ends_with("/>");
        let Some(own) = self.indentation(range.start) else {
            let new = Self::compact(lines);
            return if empty { (tag_end - 2..tag_end, format!(">{new}</link>")) } else { (tag_end..tag_end, new) };
        };
        let step = self.step(node);
        let inner = format!("{own}{step}");
        let new = format!("{}{inner}{}", self.eol, self.joined(lines, &inner, &step));
        if empty {
            let kept = self.text[..tag_end - 2].trim_end().len();
            return (kept..tag_end, format!(">{new}{}{own}</link>", self.eol));
        }
        // `<link name="a"></link>`: the end tag goes to a line of its own.
        let closing = if self.text[tag_end..].starts_with("</") { format!("{}{own}", self.eol) } else { String::new() };
        (tag_end..tag_end, new + &closing)
    }

    /// The element, and the line it stands on if it stands there alone.
    fn with_own_line(&self, node: Node<'_, '_>) -> Range<usize> {
        let range = node.range();
        let Some(indentation) = self.indentation(range.start) else { return range };
        let rest = self.text[range.end..].split('\n').next().unwrap_or("");
        if !rest.trim().is_empty() {
            return range;
        }
        let mut start = range.start - indentation.len();
        for end in ['\n', '\r'] {
            start -= usize::from(self.text[..start].ends_with(end));
        }
        start..range.end
    }

    fn friction(
        &self,
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
            let lead = self.indentation(last.range().start).map(|own| format!("{}{own}", self.eol)).unwrap_or_default();
            edits.push((at..at, lead + &new));
            return Ok(());
        }
        let start = joint.range().start;
        let tag_end = start + start_tag_length(&self.text[joint.range()]);
        edits.push(if self.text[..tag_end].ends_with("/>") {
            (tag_end - 2..tag_end, format!(">{new}</joint>"))
        } else {
            (tag_end..tag_end, new)
        });
        Ok(())
    }
}

/// Length of the start tag with which `element` begins: to the first `>` outside quotes.
fn start_tag_length(element: &str) -> usize {
    let mut quote = None;
    for (at, byte) in element.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return at + 1,
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(open), byte) if open == byte => quote = None,
            _ => {}
        }
    }
    element.len()
}
