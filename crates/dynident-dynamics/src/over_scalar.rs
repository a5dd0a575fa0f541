//! The algorithms over a scalar of the caller's own: dual numbers, intervals, symbols of a program to be written.

use crate::inverse_dynamics::newton_euler;
use crate::mass_matrix::composite_rigid_bodies;
use crate::workspace::CoreScratch;
use dynident_lanes::Scalar;
use dynident_model::Model;

/// [`inverse_dynamics`](crate::inverse_dynamics()) over any [`Scalar`]: `τ = M(q) q̈ + C(q, q̇) q̇ + g(q)` of the rigid
/// bodies, one entry per joint. Allocates its scratch, so it is not for control loops.
///
/// # Panics
/// If a vector's length is not the number of joints.
pub fn inverse_dynamics_over<T: Scalar>(model: &Model, q: &[T], dq: &[T], ddq: &[T]) -> Vec<T> {
    let mut scratch = CoreScratch::new(model.dof());
    scratch.q.copy_from_slice(q);
    scratch.dq.copy_from_slice(dq);
    scratch.ddq.copy_from_slice(ddq);
    newton_euler(model, &mut scratch);
    scratch.tau
}

/// [`mass_matrix`](crate::mass_matrix()) over any [`Scalar`]: `M(q)`, row-major, dof × dof. Allocates its scratch.
///
/// # Panics
/// If `q` has not one entry per joint.
pub fn mass_matrix_over<T: Scalar>(model: &Model, q: &[T]) -> Vec<T> {
    let mut scratch = CoreScratch::new(model.dof());
    scratch.q.copy_from_slice(q);
    composite_rigid_bodies(model, &mut scratch);
    let [matrix, ..] = scratch.matrices;
    matrix
}
