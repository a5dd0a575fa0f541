//! `<connect>` under `<equality>`: closes chains that are parallelograms, like `[[robot.loop]]` of a study.
//!
//! The two points are the anchor and the point that coincides with it in the pose as drawn. MJCF does not mark
//! passive joints: the joints of the chain that have no actuator and follow no other joint are treated as passive.

use super::classes::Stated;
use super::expanded::Expanded;
use super::fault::{MjcfError, MjcfFault};
use super::notices::{MjcfLoss, Notices};
use super::tree::LinkPlace;
use crate::error::ModelError;
use crate::loops::{self, LoopClosure, LoopError};
use crate::spatial::{Transform, Vec3};
use crate::tree::Model;
use std::collections::HashSet;

/// Maximum number of chains. Robots have few; the cost grows with the product of their sizes.
const MAX_CHAINS: usize = 16;

/// A `<connect>` that names a body and an anchor.
pub(super) struct Connect<'t> {
    pub(super) stated: Stated<'t>,
    pub(super) bodies: [String; 2],
    /// Anchor in the frame of the first body, m.
    pub(super) anchor: Vec3,
}

pub(super) struct ChainContext<'a> {
    pub(super) document: &'a Expanded,
    pub(super) links: &'a [LinkPlace],
    /// Positions in the pose as drawn, in the order of the tree.
    pub(super) references: &'a [f64],
    pub(super) driven: &'a HashSet<String>,
}

/// Closes the chains of a robot. Chains that are not parallelograms remain open; a notice reports them.
pub(super) fn closed(
    model: Model,
    connects: &[Connect<'_>],
    around: &ChainContext<'_>,
    notices: &mut Notices,
) -> Result<Model, MjcfError> {
    let mut left = |connect: &Connect<'_>, why: String| {
        let [first, second] = &connect.bodies;
        notices.note(&connect.stated, MjcfLoss::Chain { between: format!("`{first}` and `{second}`"), why });
    };
    let mut held = Vec::new();
    for (number, connect) in connects.iter().enumerate() {
        if number >= MAX_CHAINS {
            left(connect, format!("more than {MAX_CHAINS} chains are not supported"));
            continue;
        }
        match closure(&model, connect, around) {
            Ok(closure) => held.push((connect, closure)),
            Err(why) => left(connect, why),
        }
    }
    let followers = loop {
        let closures: Vec<LoopClosure> = held.iter().map(|(_, closure)| closure.clone()).collect();
        match loops::followers(&model, &closures) {
            Ok(followers) => break followers,
            Err(error) => {
                // Removes one chain: the one that the error names, otherwise the first.
                let at_fault = held.iter().position(|(_, closure)| blames(&error, closure)).unwrap_or(0);
                let (connect, _) = held.remove(at_fault);
                left(connect, error.to_string());
            }
        }
    };
    let fault = |error: ModelError| around.document.fault(around.document.root().place, MjcfFault::Model(error));
    model.with_followers(&followers).map_err(fault)
}

fn blames(error: &LoopError, closure: &LoopClosure) -> bool {
    match error {
        LoopError::Open { first, second, .. } | LoopError::NotLinear { first, second, .. } => {
            closure.links == [first.as_str(), second.as_str()]
        }
        LoopError::Undetermined { joints } => closure.passive.iter().any(|joint| joints.contains(joint)),
        _ => false,
    }
}

/// The cut of a chain, or the reason why the chain cannot be closed.
fn closure(model: &Model, connect: &Connect<'_>, around: &ChainContext<'_>) -> Result<LoopClosure, String> {
    let way = |link: &String| loops::path_to(model, link).ok_or_else(|| format!("unknown body `{link}`"));
    let [(first, first_placement), (second, second_placement)] = [way(&connect.bodies[0])?, way(&connect.bodies[1])?];
    let drawn = |path: &[usize], placement: Transform| {
        let joints = path.iter().map(|&joint| model.tree_joints()[joint].transform(around.references[joint]));
        joints.fold(Transform::IDENTITY, |sum, joint| sum.then(&joint)).then(&placement)
    };
    let origin =
        around.links.iter().find(|place| place.name == connect.bodies[0]).map_or(Vec3::ZERO, |place| place.origin);
    let point = connect.anchor - origin;
    let meets = drawn(&first, first_placement).point(point);
    let other = drawn(&second, second_placement).inverse().point(meets);
    if around.driven.is_empty() {
        return Err("no joint has an actuator; name the passive joints in [[robot.loop]]".to_owned());
    }
    let moves = |joint: &usize| first.contains(joint) != second.contains(joint);
    let free = |joint: &usize| {
        let joint = &model.tree_joints()[*joint];
        joint.mimic.is_none() && !around.driven.contains(&joint.name)
    };
    let passive: Vec<String> = (0..model.tree_joints().len())
        .filter(|joint| moves(joint) && free(joint))
        .map(|joint| model.tree_joints()[joint].name.clone())
        .collect();
    if passive.is_empty() {
        return Err("every joint of the chain has an actuator, or follows another".to_owned());
    }
    Ok(LoopClosure { links: connect.bodies.clone(), points_m: [point.0, other.0], passive })
}
