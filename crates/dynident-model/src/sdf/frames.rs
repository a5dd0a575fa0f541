//! Poses of all frames in the model.

use super::fault::{SdfError, SdfFault, fault_at};
use super::scopes::{Item, Kind, MODEL, Scopes, WORLD, full_name};
use super::values::{placement, required_text};
use crate::spatial::Transform;
use roxmltree::Node;
use std::collections::HashMap;

pub(super) struct Frames {
    model_from: HashMap<String, Transform>,
}

impl Frames {
    /// Resolves all poses to the model's frame.
    pub(super) fn new(found: &Scopes<'_, '_>) -> Result<Self, SdfError> {
        let mut model_from = HashMap::from([(String::new(), Transform::IDENTITY)]);
        for start in 0..found.items.len() {
            // Follows the chain from this frame to a frame with a known pose, then goes back along it.
            let mut chain: Vec<usize> = Vec::new();
            let mut is_on_chain = vec![false; found.items.len()];
            let mut at = start;
            while !model_from.contains_key(&found.items[at].name) {
                let item = &found.items[at];
                if core::mem::replace(&mut is_on_chain[at], true) {
                    return Err(fault_at(item.node, SdfFault::FrameLoop { name: item.name.clone() }));
                }
                chain.push(at);
                if model_from.contains_key(&item.relative_to) {
                    break;
                }
                at = *found.by_name.get(&item.relative_to).ok_or_else(|| {
                    let of = format!("the pose of `{}`", item.name);
                    fault_at(item.node, SdfFault::UnknownFrame { name: item.relative_to.clone(), of })
                })?;
            }
            for &index in chain.iter().rev() {
                let item = &found.items[index];
                let place = model_from[&item.relative_to].then(&placement(item.node)?);
                model_from.insert(item.name.clone(), place);
            }
        }
        Ok(Self { model_from })
    }

    /// `model_from_frame` by full name; the empty name is the model itself.
    pub(super) fn of(&self, name: &str) -> Option<Transform> {
        self.model_from.get(name).copied()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Carrier {
    World,
    /// A link, by its index among the items.
    Link(usize),
}

/// The link or world to which a frame is attached, by the frame's full name; `None` for a name that cannot be
/// resolved.
pub(super) fn carrier(found: &Scopes<'_, '_>, name: &str) -> Option<Carrier> {
    let mut name = name.to_owned();
    // No chain of frames is longer than the number of frames.
    for _ in 0..=found.items.len() {
        if name == WORLD {
            return Some(Carrier::World);
        }
        if name.is_empty() {
            name = canonical_link(found, found.model, "")?;
        }
        let index = *found.by_name.get(&name)?;
        let item = &found.items[index];
        name = match item.kind {
            Kind::Link => return Some(Carrier::Link(index)),
            Kind::Joint => full_name(&item.scope, required_text(item.node, "child").ok()?),
            Kind::Frame => {
                let attached = item.node.attribute("attached_to").filter(|frame| !frame.is_empty());
                full_name(&item.scope, attached.unwrap_or(MODEL))
            }
            Kind::Nested => canonical_link(found, item.node, &format!("{}::", item.name))?,
        };
    }
    None
}

/// Canonical link of a model: the link that the model names, or its first link.
fn canonical_link(found: &Scopes<'_, '_>, model: Node<'_, '_>, inner: &str) -> Option<String> {
    if let Some(link) = model.attribute("canonical_link").filter(|link| !link.is_empty()) {
        return Some(full_name(inner, link));
    }
    let of_model = |item: &&Item<'_, '_>| item.kind == Kind::Link && item.name.starts_with(inner);
    found.items.iter().find(of_model).map(|item| item.name.clone())
}
