//! The algorithms over a custom scalar: dual numbers, intervals, symbols for code generation.

use crate::body_frames::{composite_rigid_bodies, newton_euler};
use crate::workspace::CoreScratch;
use dynident_lanes::Scalar;
use dynident_model::Model;

/// Computes [`inverse_dynamics`](crate::inverse_dynamics()) over any [`Scalar`]: `τ = M(q) q̈ + C(q, q̇) q̇ + g(q)`
/// of the rigid bodies, one entry per joint. Allocates its scratch memory, so it is not suitable for control loops.
///
/// # Panics
/// If a vector's length is not the number of joints.
pub fn inverse_dynamics_over<T: Scalar>(model: &Model, q: &[T], dq: &[T], ddq: &[T]) -> Vec<T> {
    let mut scratch = CoreScratch::new(model.body_count());
    let Some(coupling) = model.coupling() else {
        scratch.q.copy_from_slice(q);
        scratch.dq.copy_from_slice(dq);
        scratch.ddq.copy_from_slice(ddq);
        newton_euler(model, &mut scratch);
        return scratch.tau;
    };
    coupling.positions(q, 1, &mut scratch.q);
    coupling.rates(dq, 1, &mut scratch.dq);
    coupling.rates(ddq, 1, &mut scratch.ddq);
    newton_euler(model, &mut scratch);
    let mut tau = vec![T::ZERO; model.dof()];
    coupling.add_projected(&scratch.tau, 1, &mut tau);
    tau
}

/// Computes [`mass_matrix`](crate::mass_matrix()) over any [`Scalar`]: `M(q)`, row-major, dof × dof. Allocates its
/// scratch memory.
///
/// # Panics
/// If `q` does not have one entry per joint.
pub fn mass_matrix_over<T: Scalar>(model: &Model, q: &[T]) -> Vec<T> {
    let mut scratch = CoreScratch::new(model.body_count());
    let Some(coupling) = model.coupling() else {
        scratch.q.copy_from_slice(q);
        composite_rigid_bodies(model, &mut scratch);
        return scratch.matrix;
    };
    coupling.positions(q, 1, &mut scratch.q);
    composite_rigid_bodies(model, &mut scratch);
    let mut matrix = vec![T::ZERO; model.dof() * model.dof()];
    coupling.project_symmetric(&scratch.matrix, &mut matrix);
    matrix
}
