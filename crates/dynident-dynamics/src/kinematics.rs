//! Forward kinematics: poses of the bodies.

use crate::workspace::Workspace;
use dynident_model::{Model, Transform};

/// `base_from_body` of every body at position `q`: rotation, and the origin of the body's frame in metres.
///
/// # Panics
/// If `q` does not have one entry per joint, or for a workspace of another size.
#[doc(alias("forward kinematics", "fk"))]
pub fn body_placements<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [Transform] {
    workspace.check(model, &[q]);
    let Workspace { placements, tree, .. } = workspace;
    let q = model.coupling().map_or(q, |coupling| tree.positions(coupling, q));
    for (index, (map, &q)) in model.maps().iter().zip(q).enumerate() {
        let (sine, cosine) = q.sin_cos();
        let own = crate::workspace::joint_transform(map, q, sine, cosine);
        placements[index] = map.parent.map_or(own, |parent| placements[parent].then(&own));
    }
    placements
}
