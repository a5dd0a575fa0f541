//! Links, joints and frames of a model and its nested models, by their full names.

use super::fault::{SdfError, SdfFault, fault_at};
use super::values::{child, children, required_text, text, word_of};
use super::{Version, notices::Notices};
use roxmltree::Node;
use std::collections::HashMap;

pub(super) const MODEL: &str = "__model__";
pub(super) const WORLD: &str = "world";
/// Maximum number of links, joints, frames and nested models. The limit is necessary because the cost of some steps
/// is quadratic in it.
const MAX_ITEMS: usize = 5000;
const MAX_NESTING: usize = 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Link,
    Joint,
    Frame,
    Nested,
}

pub(super) struct Item<'a, 'input> {
    pub(super) node: Node<'a, 'input>,
    pub(super) kind: Kind,
    /// Full name with the surrounding models: `gripper::finger`.
    pub(super) name: String,
    /// Names of the surrounding models, each followed by `::`.
    pub(super) scope: String,
    /// Full name of the frame to which the pose of the item is relative; empty for the outermost model.
    pub(super) relative_to: String,
}

/// All items in the order of the document, with their indices by name.
pub(super) struct Scopes<'a, 'input> {
    pub(super) version: Version,
    pub(super) model: Node<'a, 'input>,
    pub(super) items: Vec<Item<'a, 'input>>,
    pub(super) by_name: HashMap<String, usize>,
}

/// Full name of `name` in `scope`; empty for the frame of the outermost model.
pub(super) fn full_name(scope: &str, name: &str) -> String {
    match name {
        MODEL => scope.trim_end_matches("::").to_owned(),
        _ => match name.strip_suffix("::__model__") {
            Some(nested) => format!("{scope}{nested}"),
            None => format!("{scope}{name}"),
        },
    }
}

pub(super) fn scopes<'a, 'input>(model: Node<'a, 'input>, version: Version) -> Result<Scopes<'a, 'input>, SdfError> {
    let mut found = Scopes { version, model, items: Vec::new(), by_name: HashMap::new() };
    // Models to be visited. The innermost model is last, so that a nested model is visited before the models after
    // it.
    let mut ahead = vec![(model, String::new(), 0)];
    while let Some((model, scope, depth)) = ahead.pop() {
        if depth > MAX_NESTING {
            return Err(fault_at(model, SdfFault::TooDeep { limit: MAX_NESTING }));
        }
        let mut nested = Vec::new();
        for node in model.children().filter(Node::is_element) {
            let kind = match node.tag_name().name() {
                "link" => Kind::Link,
                "joint" => Kind::Joint,
                "frame" => Kind::Frame,
                "model" => Kind::Nested,
                _ => continue,
            };
            if found.items.len() == MAX_ITEMS {
                return Err(fault_at(node, SdfFault::TooMany { limit: MAX_ITEMS }));
            }
            let name = format!("{scope}{}", word_of(node, "name")?);
            let relative_to = full_name(&scope, relative_to(node, kind, version)?);
            if found.by_name.insert(name.clone(), found.items.len()).is_some() {
                return Err(fault_at(node, SdfFault::DuplicateName { name }));
            }
            if kind == Kind::Nested {
                nested.push((node, format!("{name}::"), depth + 1));
            }
            found.items.push(Item { node, kind, name, scope: scope.clone(), relative_to });
        }
        ahead.extend(nested.into_iter().rev());
    }
    Ok(found)
}

/// Frame to which the pose of an element is relative, by its name in the scope of the element.
fn relative_to<'a>(node: Node<'a, '_>, kind: Kind, version: Version) -> Result<&'a str, SdfError> {
    // Before version 1.7, poses of links are relative to the model, and poses of joints relative to their child.
    let stated = child(node, "pose").and_then(|pose| pose.attribute("relative_to")).filter(|frame| !frame.is_empty());
    if let Some(stated) = stated.filter(|_| version >= Version([1, 7])) {
        return Ok(stated);
    }
    Ok(match kind {
        Kind::Joint => match required_text(node, "child")? {
            WORLD => {
                let what = format!("joint `{}` with the world as its child", word_of(node, "name")?);
                return Err(fault_at(node, SdfFault::Unsupported { what, fix: "exchange <parent> and <child>" }));
            }
            child => child,
        },
        Kind::Frame => node.attribute("attached_to").filter(|frame| !frame.is_empty()).unwrap_or(MODEL),
        Kind::Link | Kind::Nested => MODEL,
    })
}

/// Adds a notice for each model in another file; these models are not read.
pub(super) fn note_includes(model: Node<'_, '_>, notices: &mut Notices) {
    for include in model.descendants().filter(|node| node.has_tag_name("include")) {
        let uri = children(include, "uri").next().map_or("", text).to_owned();
        notices.note(include, super::SdfLoss::Include { uri });
    }
}
