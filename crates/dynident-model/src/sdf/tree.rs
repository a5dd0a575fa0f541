//! Builds the tree of moving bodies from links and joints.

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

pub(super) struct Tree {
    pub(super) base: Body,
    pub(super) joints: Vec<Joint>,
    pub(super) bodies: Vec<Body>,
}

struct Connection<'s, 'a, 'input> {
    item: &'s Item<'a, 'input>,
    parent: Carrier,
    child: usize,
    /// `None` for a fixed joint.
    axis: Option<Axis>,
}

/// Builds the tree: depth first from the base, joints of a link in the order of the document, fixed joints merged.
pub(super) fn tree(found: &Scopes<'_, '_>, frames: &Frames, notices: &mut Notices) -> Result<Tree, SdfError> {
    let links: Vec<usize> = (0..found.items.len()).filter(|&index| found.items[index].kind == Kind::Link).collect();
    let Some(&first) = links.first() else {
        let missing = SdfFault::Missing { element: "model".to_owned(), kind: "element", name: "link" };
        return Err(fault_at(found.model, missing));
    };
    note_includes(found.items[first].node.document().root_element(), notices);
    let connections = connections(found, frames)?;
    let carriers = Carriers::of(found, &connections)?;
    let root = carriers.root(found, &links)?;
    let walk = Walk { found, frames, connections: &connections, under: &carriers.under };
    let Walked { tree, reached } = walk.walked(root, notices)?;
    if let Some(lost) = links.iter().find(|link| !reached.contains(link)) {
        let item = &found.items[*lost];
        return Err(fault_at(item.node, SdfFault::Loop { link: item.name.clone() }));
    }
    if tree.joints.is_empty() {
        return Err(fault_at(found.items[first].node, SdfFault::NoMovingJoint));
    }
    Ok(tree)
}

/// The joint that carries each link, and the joints that each link or the world carries.
struct Carriers {
    carried_by: HashMap<usize, usize>,
    under: HashMap<Carrier, Vec<usize>>,
}

impl Carriers {
    fn of(found: &Scopes<'_, '_>, connections: &[Connection<'_, '_, '_>]) -> Result<Self, SdfError> {
        let (mut carried_by, mut under) = (HashMap::new(), HashMap::<Carrier, Vec<usize>>::new());
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
        Ok(Self { carried_by, under })
    }

    /// The link that carries all other links; `None` if the world carries them.
    fn root(&self, found: &Scopes<'_, '_>, links: &[usize]) -> Result<Option<usize>, SdfError> {
        let mut roots = links.iter().copied().filter(|link| !self.carried_by.contains_key(link));
        match (self.under.contains_key(&Carrier::World), roots.next(), roots.next()) {
            (true, None, _) => Ok(None),
            (false, Some(only), None) => Ok(Some(only)),
            (true, Some(second), _) => Err(several(found, WORLD, second)),
            (false, Some(first), Some(second)) => Err(several(found, &found.items[first].name, second)),
            (false, None, _) => {
                let item = &found.items[links[0]];
                Err(fault_at(item.node, SdfFault::Loop { link: item.name.clone() }))
            }
        }
    }
}

struct Walk<'s, 'a, 'input> {
    found: &'s Scopes<'a, 'input>,
    frames: &'s Frames,
    connections: &'s [Connection<'s, 'a, 'input>],
    under: &'s HashMap<Carrier, Vec<usize>>,
}

struct Walked {
    tree: Tree,
    reached: HashSet<usize>,
}

/// A body (`None` for the base) and its pose in the model's frame.
#[derive(Clone, Copy)]
struct BodyPlace {
    body: Option<usize>,
    model_from_body: Transform,
}

/// A joint to be visited, with the body that carries its parent link.
struct PendingJoint {
    connection: usize,
    parent: BodyPlace,
}

impl Walk<'_, '_, '_> {
    fn walked(&self, root: Option<usize>, notices: &mut Notices) -> Result<Walked, SdfError> {
        let base = match root {
            // The base link has the frame of the model, to which it is fixed. The inertial of a fixed link can be
            // unknown.
            Some(root) => self.link(root, Transform::IDENTITY, self.model_from_link(root), &mut Notices::default())?,
            None => {
                Link { name: WORLD.to_owned(), placement: Transform::IDENTITY, inertial: None, collision: Vec::new() }
            }
        };
        let mut tree = Tree { base: Body { links: vec![base] }, joints: Vec::new(), bodies: Vec::new() };
        let mut reached: HashSet<usize> = root.into_iter().collect();
        // A stack avoids recursion, because a chain may be as long as the file.
        let mut ahead: Vec<PendingJoint> = Vec::new();
        let base_place = BodyPlace { body: None, model_from_body: Transform::IDENTITY };
        ahead.extend(self.below(root.map_or(Carrier::World, Carrier::Link), base_place));
        while let Some(PendingJoint { connection, parent }) = ahead.pop() {
            let Connection { child, axis, .. } = &self.connections[connection];
            reached.insert(*child);
            let place = match axis {
                Some(axis) => self.add_moving(connection, axis, parent, &mut tree, notices)?,
                None => self.add_fixed(*child, parent, &mut tree, notices)?,
            };
            ahead.extend(self.below(Carrier::Link(*child), place));
        }
        Ok(Walked { tree, reached })
    }

    /// The joints of a link or the world, the last one first.
    fn below(&self, carrier: Carrier, parent: BodyPlace) -> impl Iterator<Item = PendingJoint> {
        let joints = self.under.get(&carrier).map_or(&[][..], Vec::as_slice);
        joints.iter().rev().map(move |&connection| PendingJoint { connection, parent })
    }

    fn add_moving(
        &self,
        connection: usize,
        axis: &Axis,
        parent: BodyPlace,
        tree: &mut Tree,
        notices: &mut Notices,
    ) -> Result<BodyPlace, SdfError> {
        let Connection { item, child, .. } = &self.connections[connection];
        let link_place = self.model_from_link(*child);
        let joint_place = self.frames.of(&item.name).unwrap_or(link_place);
        let place = Transform { rotation: link_place.rotation, translation: joint_place.translation };
        tree.joints.push(Joint {
            name: item.name.clone(),
            kind: axis.kind,
            parent: parent.body,
            placement: parent.model_from_body.inverse().then(&place),
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
        tree.bodies.push(Body { links: vec![self.link(*child, Transform::IDENTITY, shift, notices)?] });
        Ok(BodyPlace { body: Some(tree.bodies.len() - 1), model_from_body: place })
    }

    fn add_fixed(
        &self,
        child: usize,
        parent: BodyPlace,
        tree: &mut Tree,
        notices: &mut Notices,
    ) -> Result<BodyPlace, SdfError> {
        let placement = parent.model_from_body.inverse().then(&self.model_from_link(child));
        // The inertial of a fixed link can be unknown, without a notice.
        let mut unheard = Notices::default();
        let (body, notices) = match parent.body {
            Some(body) => (&mut tree.bodies[body], notices),
            None => (&mut tree.base, &mut unheard),
        };
        body.links.push(self.link(child, placement, Transform::IDENTITY, notices)?);
        Ok(parent)
    }

    fn model_from_link(&self, index: usize) -> Transform {
        self.frames.of(&self.found.items[index].name).unwrap_or(Transform::IDENTITY)
    }

    /// Creates a link of a body. `shift` moves its shapes and its inertial to the frame of the joint; only the first
    /// link of a body is shifted.
    fn link(
        &self,
        index: usize,
        body_from_link: Transform,
        shift: Transform,
        notices: &mut Notices,
    ) -> Result<Link, SdfError> {
        let item = &self.found.items[index];
        let mut collision = shapes(item.node);
        for shape in &mut collision {
            shape.placement = shift.then(&shape.placement);
        }
        let stays = shift == Transform::IDENTITY;
        // Without a shift the numbers are not changed by rounding.
        let shifted = |inertial: InertialParameters| if stays { inertial } else { inertial.expressed_in(&shift) };
        let inertial = inertial(item, notices)?.map(shifted);
        Ok(Link { name: item.name.clone(), placement: body_from_link, inertial, collision })
    }
}

fn several(found: &Scopes<'_, '_>, first: &str, second: usize) -> SdfError {
    let item = &found.items[second];
    fault_at(item.node, SdfFault::SeveralRoots { first: first.to_owned(), second: item.name.clone() })
}

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
