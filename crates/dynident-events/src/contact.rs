//! Share of the residual torque that one force and one moment on a link explain.

use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{JointKind, Model, Vec3};
use nalgebra::{DMatrix, DVector};

/// Joint torques for unit forces and moments in the base frame at the origin of `body`: the matrix `Jᵀ` of `τ = Jᵀ w`
/// with six columns, for the wrench w.
fn jacobian_transposed(model: &Model, workspace: &mut Workspace, q: &[f64], body: usize) -> DMatrix<f64> {
    let placements = body_placements(model, workspace, q);
    let at = placements[body].translation;
    let mut out = DMatrix::zeros(model.dof(), 6);
    for joint in 0..model.dof() {
        let own = model.body_of(joint);
        if !model.moves(joint, body) {
            continue;
        }
        let axis = placements[own].rotation.mul_vec(model.joints()[joint].axis);
        let origin = placements[own].translation;
        let arm = Vec3::new(at.0[0] - origin.0[0], at.0[1] - origin.0[1], at.0[2] - origin.0[2]);
        let (force, moment) = match model.joints()[joint].kind {
            JointKind::Prismatic => (axis, Vec3::new(0.0, 0.0, 0.0)),
            JointKind::Revolute | JointKind::Continuous => (axis.cross(arm), axis),
        };
        for k in 0..3 {
            out[(joint, k)] = force.0[k];
            out[(joint, 3 + k)] = moment.0[k];
        }
    }
    out
}

/// Share of the weighted squared `torques` (by instant, then joint) that a constant force and moment on `body` explain.
/// `weights` are the inverse standard deviations of the joints' residuals.
pub(crate) fn share_by_wrench(
    model: &Model,
    positions: &[Vec<f64>],
    torques: &[Vec<f64>],
    weights: &[f64],
    body: usize,
) -> f64 {
    let mut workspace = Workspace::new(model);
    let (mut gram, mut right, mut all) = (DMatrix::zeros(6, 6), DVector::zeros(6), 0.0);
    for (q, torque) in positions.iter().zip(torques) {
        let mut columns = jacobian_transposed(model, &mut workspace, q, body);
        let mut torque = DVector::from_column_slice(torque);
        for (joint, weight) in weights.iter().enumerate() {
            columns.row_mut(joint).scale_mut(*weight);
            torque[joint] *= weight;
        }
        gram += columns.tr_mul(&columns);
        right += columns.tr_mul(&torque);
        all += torque.norm_squared();
    }
    let ridge = 1e-6 * gram.trace() / 6.0 + f64::MIN_POSITIVE;
    for place in 0..6 {
        gram[(place, place)] += ridge;
    }
    let Some(factor) = gram.cholesky() else { return 0.0 };
    if all > 0.0 { factor.solve(&right).dot(&right) / all } else { 0.0 }
}
