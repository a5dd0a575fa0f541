//! From links and joints to the tree of moving bodies.

use super::axes::{Axis, axis};
use super::elements::{inertial, shapes};
use super::fault::{SdfError, SdfFault, fault_at};
use super::frames::{Carrier, Frames, carrier};
use super::notices::Notices;
use super::scopes::{Item, Kind, Scopes, WORLD, full_name, note_includes};
use super::values::{required_text, word_of};
use crate::inertial::InertialParameters;
use crate::joint::Joint;
use crate::spatial::Transform;
use crate::tree::{Body, Link};
use crate::urdf::MAX_MOVING_JOINTS;
use crate::xml::shortened;
use std::collections::{HashMap, HashSet};

/// The parts of the model.
pub(super) struct Tree {
    pub(super) base: Body,
    pub(super) joints: Vec<Joint>,
    pub(super) bodies: Vec<Body>,
}

/// A joint between two links, or the world and a link.
struct Connection<'s, 'a, 'input> {
    item: &'s Item<'a, 'input>,
    parent: Carrier,
    child: usize,
    /// `None` for a fixed joint.
    axis: Option<Axis>,
}

/// The tree: depth first from the base, joints under a link in the order of the document, fixed joints lumped.
pub(super) fn tree(found: &Scopes<'_, '_>, frames: &Frames, notices: &mut Notices) -> Result<Tree, SdfError> {
    let links: Vec<usize> = (0..found.items.len()).filter(|&index| found.items[index].kind == Kind::Link).collect();
    let Some(&first) = links.first() else {
        let missing = SdfFault::Missing { element: "model".to_owned(), kind: "element", name: "link" };
        return Err(fault_at(found.model, missing));
    };
    note_includes(found.items[first].node.document().root_element(), notices);
    let connections = connections(found, frames)?;

    // Who carries whom.
    let mut carried_by: HashMap<usize, usize> = HashMap::new();
    let mut under: HashMap<Carrier, Vec<usize>> = HashMap::new();
    for (number, connection) in connections.iter().enumerate() {
        if let Some(first) = carried_by.insert(connection.child, number) {
            let fault = SdfFault::TwoParents {
                link: found.items[connection.child].name.clone(),
                first: connections[first].item.name.clone(),
                second: connection.item.name.clone(),
            };
            return Err(fault_at(connection.item.node, fault));
        }
        under.entry(connection.parent).or_default().push(number);
    }
    // The world carries everything, or one link does.
    let mut roots = links.iter().copied().filter(|link| !carried_by.contains_key(link));
    let root = match (under.contains_key(&Carrier::World), roots.next(), roots.next()) {
        (true, None, _) => None,
        (false, Some(only), None) => Some(only),
        (true, Some(second), _) => return Err(several(found, WORLD, second)),
        (false, Some(first), Some(second)) => return Err(several(found, &found.items[first].name, second)),
        (false, None, _) => {
            let item = &found.items[first];
            return Err(fault_at(item.node, SdfFault::Loop { link: item.name.clone() }));
        }
    };

    let mut link_at = |index: usize, body_from_link: Transform, shift: Transform, moves: bool| {
        let item = &found.items[index];
        // The body's own link is moved to the joint; the frame of every other one stays.
        let moved = |shape: &mut crate::collision::CollisionShape| shape.placement = shift.then(&shape.placement);
        let mut collision = shapes(item.node);
        collision.iter_mut().for_each(moved);
        let stays = shift == Transform::IDENTITY;
        // What stands still may be unknown.
        let mut unheard = Notices::default();
        let notices = if moves { &mut *notices } else { &mut unheard };
        // Exact numbers stay exact where nothing is shifted.
        let shifted = |inertial: InertialParameters| if stays { inertial } else { inertial.expressed_in(&shift) };
        let inertial = inertial(item, notices)?.map(shifted);
        Ok::<Link, SdfError>(Link { name: item.name.clone(), placement: body_from_link, inertial, collision })
    };
    let model_from_link = |index: usize| frames.of(&found.items[index].name).unwrap_or(Transform::IDENTITY);
    let world =
        || Link { name: WORLD.to_owned(), placement: Transform::IDENTITY, inertial: None, collision: Vec::new() };
    let base = match root {
        // The base's own link is at the identity: the frame of the model, to which the link is fixed.
        Some(root) => link_at(root, Transform::IDENTITY, model_from_link(root), false)?,
        None => world(),
    };
    let mut tree = Tree { base: Body { links: vec![base] }, joints: Vec::new(), bodies: Vec::new() };
    let mut reached: HashSet<usize> = root.into_iter().collect();
    // Joints still to visit, with the body that carries their parent link and its place. A stack, not recursion: a
    // chain may be as long as the file.
    let mut ahead: Vec<(usize, Option<usize>, Transform)> = Vec::new();
    let visit_later = |ahead: &mut Vec<_>, link: Carrier, body: Option<usize>, model_from_body: Transform| {
        let below = under.get(&link).map_or(&[][..], Vec::as_slice);
        ahead.extend(below.iter().rev().map(|&joint| (joint, body, model_from_body)));
    };
    visit_later(&mut ahead, root.map_or(Carrier::World, Carrier::Link), None, Transform::IDENTITY);
    while let Some((number, body, model_from_body)) = ahead.pop() {
        let Connection { item, child, axis, .. } = &connections[number];
        reached.insert(*child);
        let link_place = model_from_link(*child);
        if let Some(axis) = axis {
            let joint_place = frames.of(&item.name).unwrap_or(link_place);
            let place = Transform { rotation: link_place.rotation, translation: joint_place.translation };
            tree.joints.push(Joint {
                name: item.name.clone(),
                kind: axis.kind,
                parent: body,
                placement: model_from_body.inverse().then(&place),
                axis: place.rotation.transpose_mul_vec(axis.direction),
                limits: axis.limits,
                damping: axis.damping,
                friction: axis.friction,
                drive_inertia: None,
                spring: axis.spring,
                mimic: axis.mimic.clone(),
            });
            if tree.joints.len() > MAX_MOVING_JOINTS {
                return Err(fault_at(item.node, SdfFault::TooManyJoints { limit: MAX_MOVING_JOINTS }));
            }
            let shift = place.inverse().then(&link_place);
            tree.bodies.push(Body { links: vec![link_at(*child, Transform::IDENTITY, shift, true)?] });
            visit_later(&mut ahead, Carrier::Link(*child), Some(tree.bodies.len() - 1), place);
        } else {
            let placement = model_from_body.inverse().then(&link_place);
            let link = link_at(*child, placement, Transform::IDENTITY, body.is_some())?;
            body.map_or(&mut tree.base, |body| &mut tree.bodies[body]).links.push(link);
            visit_later(&mut ahead, Carrier::Link(*child), body, model_from_body);
        }
    }
    if let Some(lost) = links.iter().find(|link| !reached.contains(link)) {
        let item = &found.items[*lost];
        return Err(fault_at(item.node, SdfFault::Loop { link: item.name.clone() }));
    }
    if tree.joints.is_empty() {
        return Err(fault_at(found.items[first].node, SdfFault::NoMovingJoint));
    }
    Ok(tree)
}

fn several(found: &Scopes<'_, '_>, first: &str, second: usize) -> SdfError {
    let item = &found.items[second];
    fault_at(item.node, SdfFault::SeveralRoots { first: first.to_owned(), second: item.name.clone() })
}

/// All joints of the document.
fn connections<'s, 'a, 'input>(
    found: &'s Scopes<'a, 'input>,
    frames: &Frames,
) -> Result<Vec<Connection<'s, 'a, 'input>>, SdfError> {
    let mut connections = Vec::new();
    for item in found.items.iter().filter(|item| item.kind == Kind::Joint) {
        let end = |which: &'static str| -> Result<Carrier, SdfError> {
            let written = required_text(item.node, which)?;
            let name = if written == WORLD { WORLD.to_owned() } else { full_name(&item.scope, written) };
            carrier(found, &name).ok_or_else(|| {
                let of = format!("<{which}> of joint `{}`", item.name);
                fault_at(item.node, SdfFault::UnknownFrame { name: written.to_owned(), of })
            })
        };
        let (parent, child) = (end("parent")?, end("child")?);
        let Carrier::Link(child) = child else {
            let what = format!("joint `{}` whose child does not move", item.name);
            return Err(fault_at(
                item.node,
                SdfFault::Unsupported { what, fix: "name the link that moves in <child>" },
            ));
        };
        if parent == Carrier::Link(child) {
            let link = found.items[child].name.clone();
            return Err(fault_at(item.node, SdfFault::SameLink { joint: item.name.clone(), link }));
        }
        let slides = match word_of(item.node, "type")? {
            "revolute" | "continuous" => Some(false),
            "prismatic" => Some(true),
            "fixed" => None,
            other => {
                let what = format!("joint `{}` of type {}", item.name, shortened(other));
                let fix = match other {
                    "revolute2" | "universal" => "write it as two revolute joints with a link between",
                    "ball" => "write it as three revolute joints with links between, or fix it",
                    _ => "write it as revolute, continuous, prismatic or fixed",
                };
                return Err(fault_at(item.node, SdfFault::Unsupported { what, fix }));
            }
        };
        let axis = slides.map(|slides| axis(item, slides, found.version, frames)).transpose()?;
        connections.push(Connection { item, parent, child, axis });
    }
    Ok(connections)
}
