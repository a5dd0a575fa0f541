//! Kinetic and potential energy.

use crate::kinematics::body_placements;
use crate::mass_matrix::mass_matrix;
use crate::workspace::Workspace;
use dynident_model::Model;

/// Kinetic energy `½ q̇ᵀ M(q) q̇` in joules.
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another size.
pub fn kinetic_energy(model: &Model, workspace: &mut Workspace, q: &[f64], dq: &[f64]) -> f64 {
    workspace.check(model, &[dq]);
    let matrix = mass_matrix(model, workspace, q);
    let rows = matrix.chunks_exact(dq.len().max(1)).zip(dq);
    0.5 * rows.map(|(row, v)| v * row.iter().zip(dq).map(|(m, w)| m * w).sum::<f64>()).sum::<f64>()
}

/// Potential energy `- Σ gᵀ (m_i p_i + R_i h_i)` in joules, zero for bodies at the base's origin.
///
/// # Panics
/// If `q` does not have one entry per joint, or for a workspace of another size.
pub fn potential_energy(model: &Model, workspace: &mut Workspace, q: &[f64]) -> f64 {
    let gravity = model.gravity();
    let placements = body_placements(model, workspace, q);
    -placements
        .iter()
        .zip(model.inertials())
        .map(|(placement, inertial)| {
            let moment =
                placement.rotation.mul_vec(inertial.first_moment()) + placement.translation.scale(inertial.mass_kg());
            gravity.dot(moment)
        })
        .sum::<f64>()
}
