//! Both sides of the equation of motion at once, for simulation.

use crate::inverse_dynamics::newton_euler_placed;
use crate::mass_matrix::composite_rigid_bodies_placed;
use crate::tree_scratch::TreeScratch;
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::Model;

/// Mass matrix `M(q)` (row-major, dof × dof) and bias `C(q, q̇) q̇ + g(q)` (Nm, N) of the rigid bodies: `M q̈ + bias =
/// τ`.
///
/// The same numbers as [`mass_matrix`](crate::mass_matrix()) and [`inverse_dynamics`](crate::inverse_dynamics())
/// without acceleration, with the transforms of the joints made once. Allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or the workspace was made for another size.
#[doc(alias("nonlinear effects", "coriolis", "nle"))]
pub fn mass_matrix_and_bias<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
) -> (&'w [f64], &'w [f64]) {
    workspace.check(model, &[q, dq]);
    let Workspace { level, scratch, vector, matrices, tree, .. } = workspace;
    let matrix = &mut matrices[0];
    if let Some(coupling) = model.coupling() {
        let TreeScratch { q: tree_q, dq: tree_dq, tau, matrices: [tree_matrix, ..], .. } = tree;
        coupling.positions(q, 1, tree_q);
        coupling.rates(dq, 1, tree_dq);
        dispatch_single(*level, Single { model, scratch, q: tree_q, dq: tree_dq, matrix: tree_matrix, bias: tau });
        coupling.project_symmetric(tree_matrix, matrix);
        vector.fill(0.0);
        coupling.add_projected(tau, 1, vector);
    } else {
        dispatch_single(*level, Single { model, scratch, q, dq, matrix, bias: vector });
    }
    (&matrices[0], vector)
}

one_sample_kernel!((q, dq), bias_and_mass, bias: tau, matrix: matrices[0]);

/// From `q` and `dq` of the scratch to its `tau` and its first matrix.
#[inline(always)]
fn bias_and_mass<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    scratch.ddq.fill(T::ZERO);
    scratch.place(model.maps());
    newton_euler_placed(model, scratch);
    composite_rigid_bodies_placed(model, scratch);
}
