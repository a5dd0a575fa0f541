//! Builds the tree of moving bodies from links and joints.

use super::elements::{JointElement, LinkElement};
use super::{UrdfError, UrdfFault, UrdfIrregularity, fault_at};
use crate::joint::Joint;
use crate::place::Located;
use crate::spatial::Transform;
use crate::tree::{Body, Link, Model};
use std::collections::HashMap;

/// Builds the model: depth first from the root, joints of a link in the order of the document, fixed joints merged.
pub(super) fn model(
    name: &str,
    links: &[LinkElement<'_, '_>],
    joints: &[JointElement<'_, '_>],
) -> Result<Model, UrdfError> {
    let connections = Connections::of(links, joints)?;
    refuse_own_mimics(joints)?;
    let root = connections.root(links)?;
    let link_at = |index: usize, placement| Link {
        name: links[index].name.to_owned(),
        placement,
        inertial: links[index].inertial,
        collision: links[index].collision.clone(),
    };
    let mut base = Body { links: vec![link_at(root, Transform::IDENTITY)] };
    let (mut tree_joints, mut bodies) = (Vec::new(), Vec::<Body>::new());
    let mut reached = vec![false; links.len()];
    reached[root] = true;
    // Joints to be visited, with the body of their parent link and the pose of that link in the body. A stack avoids
    // recursion, because a chain can be as long as the file.
    let mut ahead: Vec<(usize, Option<usize>, Transform)> = Vec::new();
    let visit_later = |ahead: &mut Vec<_>, link: usize, body: Option<usize>, placement: Transform| {
        ahead.extend(connections.joints_under[link].iter().rev().map(|&joint| (joint, body, placement)));
    };
    visit_later(&mut ahead, root, None, Transform::IDENTITY);
    while let Some((index, body, body_from_parent)) = ahead.pop() {
        let (joint, child) = (&joints[index], connections.child_of[index]);
        reached[child] = true;
        let placement = body_from_parent.then(&joint.origin);
        if let Some(kind) = joint.kind {
            tree_joints.push(Joint {
                name: joint.name.to_owned(),
                kind,
                parent: body,
                placement,
                axis: joint.axis,
                limits: joint.limits,
                damping: joint.damping,
                friction: joint.friction,
                drive_inertia: None,
                spring: None,
                mimic: joint.mimic.clone(),
            });
            bodies.push(Body { links: vec![link_at(child, Transform::IDENTITY)] });
            visit_later(&mut ahead, child, Some(bodies.len() - 1), Transform::IDENTITY);
        } else {
            body.map_or(&mut base, |body| &mut bodies[body]).links.push(link_at(child, placement));
            visit_later(&mut ahead, child, body, placement);
        }
    }
    if let Some(lost) = reached.iter().position(|&reached| !reached) {
        return Err(fault_at(links[lost].node, UrdfFault::Loop { link: links[lost].name.to_owned() }));
    }
    if tree_joints.is_empty() {
        return Err(robot_fault(UrdfFault::NoMovingJoint));
    }
    Model::new(name, base, tree_joints, bodies).map_err(|error| robot_fault(UrdfFault::Model(error)))
}

fn robot_fault(fault: UrdfFault) -> UrdfError {
    Located { line: 1, column: 1, fault }
}

struct Connections {
    child_of: Vec<usize>,
    parent_joint: Vec<Option<usize>>,
    joints_under: Vec<Vec<usize>>,
}

impl Connections {
    /// Resolves the links of all joints; rejects unknown links and two joints with the same child link.
    fn of(links: &[LinkElement<'_, '_>], joints: &[JointElement<'_, '_>]) -> Result<Self, UrdfError> {
        let index_of: HashMap<&str, usize> = links.iter().enumerate().map(|(index, link)| (link.name, index)).collect();
        let mut parent_joint: Vec<Option<usize>> = vec![None; links.len()];
        let mut joints_under: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        let mut child_of = Vec::with_capacity(joints.len());
        for (index, joint) in joints.iter().enumerate() {
            let find = |link: &str| {
                index_of.get(link).copied().ok_or_else(|| {
                    fault_at(joint.node, UrdfFault::UnknownLink { joint: joint.name.to_owned(), link: link.to_owned() })
                })
            };
            let (parent, child) = (find(joint.parent)?, find(joint.child)?);
            if let Some(first) = parent_joint[child].replace(index) {
                let fault = UrdfFault::TwoParents {
                    link: joint.child.to_owned(),
                    first: joints[first].name.to_owned(),
                    second: joint.name.to_owned(),
                };
                return Err(fault_at(joint.node, fault));
            }
            joints_under[parent].push(index);
            child_of.push(child);
        }
        Ok(Self { child_of, parent_joint, joints_under })
    }

    fn root(&self, links: &[LinkElement<'_, '_>]) -> Result<usize, UrdfError> {
        let mut roots = (0..links.len()).filter(|&link| self.parent_joint[link].is_none());
        match (roots.next(), roots.next()) {
            (Some(root), None) => Ok(root),
            (Some(first), Some(second)) => {
                let (first, node) = (links[first].name.to_owned(), links[second].node);
                Err(fault_at(node, UrdfFault::SeveralRoots { first, second: links[second].name.to_owned() }))
            }
            (None, _) => match links.first() {
                Some(link) => Err(fault_at(link.node, UrdfFault::Loop { link: link.name.to_owned() })),
                None => Err(robot_fault(UrdfFault::NoLinks)),
            },
        }
    }
}

fn refuse_own_mimics(joints: &[JointElement<'_, '_>]) -> Result<(), UrdfError> {
    match joints.iter().find(|joint| joint.mimic.as_ref().is_some_and(|mimic| mimic.sources[0].joint == joint.name)) {
        None => Ok(()),
        Some(joint) => Err(fault_at(joint.node, UrdfFault::OwnMimic { joint: joint.name.to_owned() })),
    }
}

/// Joints that follow a joint that is not in the document; this is frequent if the URDF is a part of a larger robot.
pub(super) fn unknown_mimics(joints: &[JointElement<'_, '_>]) -> Vec<UrdfIrregularity> {
    let names: std::collections::HashSet<&str> = joints.iter().map(|joint| joint.name).collect();
    let unknown = joints.iter().filter_map(|joint| {
        let source = &joint.mimic.as_ref()?.sources[0].joint;
        (!names.contains(source.as_str())).then(|| UrdfIrregularity::UnknownMimic {
            line: joint.node.document().text_pos_at(joint.node.range().start).row,
            joint: joint.name.to_owned(),
            source_joint: source.clone(),
        })
    });
    unknown.collect()
}
