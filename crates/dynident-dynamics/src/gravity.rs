//! Gravity torque.

use crate::inverse_dynamics::inverse_dynamics;
use crate::workspace::Workspace;
use dynident_model::Model;

/// Torques `g(q)` that hold the robot at rest, Nm (N): inverse dynamics without motion.
///
/// # Panics
/// If `q` has not one entry per joint, or the workspace was made for another size.
#[doc(alias("generalized gravity", "gravity vector"))]
pub fn gravity_torque<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [f64] {
    // A joint vector of zeros without allocating: robots in this field have at most some tens of joints.
    const ZEROS: [f64; 1024] = [0.0; 1024];
    let rest = &ZEROS[..model.dof()];
    inverse_dynamics(model, workspace, q, rest, rest)
}
