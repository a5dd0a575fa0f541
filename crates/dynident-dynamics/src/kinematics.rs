//! Forward kinematics: poses of the bodies, and the Jacobian of a point.

use crate::workspace::Workspace;
use dynident_model::{Model, Transform, Vec3};

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

/// Velocity of a point for unit velocities of the joints, in the base frame: `v = J_v q̇`, `ω = J_ω q̇`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointJacobian {
    /// `J_v`, m/s per rad/s (m/s): one vector for each degree of freedom.
    pub linear: Vec<Vec3>,
    /// `J_ω`, rad/s per rad/s (m/s).
    pub angular: Vec<Vec3>,
}

/// Geometric Jacobian of the point `point` (m, in the frame of body `body`) at position `q`: a rotary joint with the
/// axis z through o contributes `z × (p − o)` and z, a prismatic one z and 0. Siciliano et al., Robotics (2009), 3.1.
///
/// # Panics
/// If `q` does not have one entry per joint, for a body that does not exist, or for a workspace of another size.
pub fn point_jacobian(model: &Model, workspace: &mut Workspace, q: &[f64], body: usize, point: Vec3) -> PointJacobian {
    let placements = body_placements(model, workspace, q);
    let point = placements[body].point(point);
    let zeros = || vec![Vec3::ZERO; model.dof()];
    let mut found = PointJacobian { linear: zeros(), angular: zeros() };
    let mut at = Some(body);
    while let Some(index) = at {
        let map = &model.maps()[index];
        let placement = &placements[index];
        let axis = placement.rotation.mul_vec(map.axis);
        let (linear, angular) =
            if map.is_rotary { (axis.cross(point - placement.translation), axis) } else { (axis, Vec3::ZERO) };
        for (joint, ratio) in model.drivers(index) {
            found.linear[joint] += linear.scale(ratio);
            found.angular[joint] += angular.scale(ratio);
        }
        at = map.parent;
    }
    found
}
