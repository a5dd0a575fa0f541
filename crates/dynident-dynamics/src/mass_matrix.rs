//! The joint-space mass matrix: the composite-rigid-body algorithm.

use crate::composite::Composite;
use crate::tree_scratch::TreeScratch;
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::{Model, Vec3};

/// The mass matrix `M(q)`, row-major, symmetric, dof × dof: `∂τ/∂q̈` of the inverse dynamics.
///
/// Composite-rigid-body algorithm: Walker and Orin (1982); Featherstone (2008), section 6.2. Allocation-free.
///
/// # Panics
/// If `q` has not one entry per joint, or the workspace was made for another size.
#[doc(alias("crba", "inertia matrix", "joint-space inertia"))]
pub fn mass_matrix<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64]) -> &'w [f64] {
    workspace.check(model, &[q]);
    let Workspace { level, scratch, matrices, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        let TreeScratch { q: tree_q, matrices: [out, ..], .. } = tree;
        coupling.positions(q, 1, tree_q);
        dispatch_single(*level, Single { model, scratch, q: tree_q, out });
        coupling.project_symmetric(out, &mut matrices[0]);
    } else {
        dispatch_single(*level, Single { model, scratch, q, out: &mut matrices[0] });
    }
    &matrices[0]
}

one_sample_kernel!((q), composite_rigid_bodies, out: matrices[0]);

/// From `q` of the scratch to its first matrix.
#[inline(always)]
pub(crate) fn composite_rigid_bodies<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    scratch.place(model.maps());
    composite_rigid_bodies_placed(model, scratch);
}

/// The same with the transforms in place.
#[inline(always)]
pub(crate) fn composite_rigid_bodies_placed<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let (maps, dof) = (model.maps(), model.body_count());
    for (composite, inertial) in scratch.composites.iter_mut().zip(model.inertials()) {
        *composite = Composite::of(inertial);
    }
    let matrix = &mut scratch.matrices[0];
    // Joints on different branches do not couple; every entry along a path is written below.
    matrix.fill(T::ZERO);
    for index in (0..dof).rev() {
        let map = &maps[index];
        let axis = map.axis.splat::<T>();
        let (inner, outer) = scratch.composites.split_at_mut(index);
        let composite = &outer[0];
        // Force and moment that accelerate the composite along its joint's axis.
        let (mut force, mut moment) = if map.turns {
            (axis.cross(composite.first_moment), composite.inertia_matrix().mul_vec(axis))
        } else {
            (axis.scale(composite.mass), composite.first_moment.cross(axis))
        };
        matrix[index * dof + index] = axis.dot(if map.turns { moment } else { force });
        let (mut at, mut link) = (index, map.parent);
        while let Some(parent) = link {
            let frame = &scratch.bodies[at].parent_from_body;
            let map = &maps[parent];
            force = frame.rotation.mul_vec(force);
            moment = frame.translation.cross_add(force, frame.rotation.mul_vec(moment));
            let along: Vec3<T> = map.axis.splat();
            let entry = along.dot(if map.turns { moment } else { force });
            matrix[index * dof + parent] = entry;
            matrix[parent * dof + index] = entry;
            (at, link) = (parent, map.parent);
        }
        if let Some(parent) = map.parent {
            inner[parent].add(composite, &scratch.bodies[index].parent_from_body);
        }
    }
}
