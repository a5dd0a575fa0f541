//! Forward dynamics: the articulated-body algorithm.

use crate::hinge::{Hinge, PlacedHinges, symmetric, with_hinge};
use crate::inverse_dynamics::outward;
use crate::motion_equation::mass_matrix_and_bias;
use crate::states::{ArticulatedInertia, LinkMotion};
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::{JointStep, Mat3, Model, Vec3};

/// Computes the joint accelerations `q̈ = M(q)⁻¹ (τ - C(q, q̇) q̇ - g(q))` of the rigid bodies, rad/s² (m/s²).
///
/// Articulated-body algorithm: Featherstone (2008), section 7.3, over the model's inner frames
/// ([`JointStep`](dynident_model::JointStep)); the velocity terms come from the outward recursion of the inverse
/// dynamics. Allocation-free. The acceleration of a joint that moves no inertia (massless tip) is undefined (infinite
/// or NaN): check [`Model::bodies_without_prior`] first.
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another size.
#[doc(alias("aba", "articulated body"))]
pub fn forward_dynamics<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    tau: &[f64],
) -> &'w [f64] {
    workspace.check(model, &[q, dq, tau]);
    if model.coupling().is_some() {
        return of_coupled_joints(model, workspace, q, dq, tau);
    }
    let Workspace { level, scratch, vector, .. } = workspace;
    dispatch_single(*level, Single { model, scratch, q, dq, tau, ddq: vector });
    vector
}

one_sample_kernel!((q, dq, tau), articulated_bodies, ddq: ddq);

/// Coupled joints: a subtree has no separate articulated inertia. `M q̈ = τ - bias` is therefore solved by a Cholesky
/// factorisation, which exists if every degree of freedom moves inertia.
fn of_coupled_joints<'w>(model: &Model, workspace: &'w mut Workspace, q: &[f64], dq: &[f64], tau: &[f64]) -> &'w [f64] {
    mass_matrix_and_bias(model, workspace, q, dq);
    let (dof, Workspace { vector, matrices: [factor, ..], .. }) = (model.dof(), workspace);
    for (bias, tau) in vector.iter_mut().zip(tau) {
        *bias = tau - *bias;
    }
    for row in 0..dof {
        for column in 0..=row {
            let products = (0..column).map(|k| factor[row * dof + k] * factor[column * dof + k]);
            let rest = factor[row * dof + column] - products.sum::<f64>();
            factor[row * dof + column] = if row == column { rest.sqrt() } else { rest / factor[column * dof + column] };
        }
        let known: f64 = (0..row).map(|k| factor[row * dof + k] * vector[k]).sum();
        vector[row] = (vector[row] - known) / factor[row * dof + row];
    }
    for row in (0..dof).rev() {
        let known: f64 = (row + 1..dof).map(|k| factor[k * dof + row] * vector[k]).sum();
        vector[row] = (vector[row] - known) / factor[row * dof + row];
    }
    vector
}

/// Subtracts `v wᵀ` (symmetric: w is a multiple of v) from a symmetric matrix.
#[inline(always)]
fn subtract_outer<T: Scalar>(m: &mut [T; 6], v: Vec3<T>, w: Vec3<T>) {
    m[0] = v[0].neg_mul_add(w[0], m[0]);
    m[1] = v[0].neg_mul_add(w[1], m[1]);
    m[2] = v[0].neg_mul_add(w[2], m[2]);
    m[3] = v[1].neg_mul_add(w[1], m[3]);
    m[4] = v[1].neg_mul_add(w[2], m[4]);
    m[5] = v[2].neg_mul_add(w[2], m[5]);
}

/// `[t]× M`: t × every column of M.
#[inline(always)]
fn cross_columns<T: Scalar>(t: Vec3<T>, m: &Mat3<T>) -> Mat3<T> {
    let m = &m.0;
    let a = t.cross(Vec3([m[0][0], m[1][0], m[2][0]]));
    let b = t.cross(Vec3([m[0][1], m[1][1], m[2][1]]));
    let c = t.cross(Vec3([m[0][2], m[1][2], m[2][2]]));
    Mat3([[a[0], b[0], c[0]], [a[1], b[1], c[1]], [a[2], b[2], c[2]]])
}

/// Computes `ddq` of the scratch from its `q`, `dq`, `tau`.
#[inline(always)]
pub(crate) fn articulated_bodies<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let steps = model.steps();
    let joints = steps.len();
    scratch.hinges.place(steps, &scratch.q);
    let hinges = scratch.hinges.placed(joints);
    let (motions, wrenches) = (&mut scratch.motions[..joints], &mut scratch.wrenches[..joints]);
    let articulated = &mut scratch.articulated[..joints];
    let (tau, ddq) = (&scratch.tau[..joints], &mut scratch.ddq[..joints]);
    // With q̈ = 0 the outward recursion gives the velocity-dependent and gravity accelerations of the bodies; their
    // wrench is the bias. The remaining accelerations are linear in the joint accelerations.
    ddq.fill(T::ZERO);
    outward(model, hinges, motions, wrenches, &scratch.dq[..joints], ddq);
    for (own, step) in articulated.iter_mut().zip(steps) {
        let [xx, xy, xz, yy, yz, zz] = step.second;
        own.rotation = [yy + zz, -xy, -xz, xx + zz, -yz, xx + yy].map(T::splat);
        own.coupling = Mat3::skew(step.first.splat());
        let mass = T::splat(step.mass);
        own.mass = [mass, T::ZERO, T::ZERO, mass, T::ZERO, mass];
    }
    for index in (0..joints).rev() {
        let step = &steps[index];
        let (inner, outer) = wrenches.split_at_mut(index);
        let link = &outer[0];
        let (inner_inertias, outer_inertias) = articulated.split_at_mut(index);
        let own = &mut outer_inertias[0];
        let ([j, m], h) = ([own.rotation, own.mass], own.coupling);
        // Column of the inertia along (about) the joint's axis z: moment, force.
        let column = if step.is_rotary {
            (Vec3([j[2], j[4], j[5]]), Vec3(h.0[2]))
        } else {
            (Vec3([h.0[0][2], h.0[1][2], h.0[2][2]]), Vec3([m[2], m[4], m[5]]))
        };
        let along = |moment: Vec3<T>, force: Vec3<T>| if step.is_rotary { moment[2] } else { force[2] };
        own.inverse_inertia = along(column.0, column.1).recip();
        own.rest_torque = tau[index] - along(link.moment, link.force);
        let Some(parent) = step.parent else { continue };
        // The parent receives inertia and bias without the part that the joint cannot transmit. Both are moved to the
        // parent's frame before the subtraction, so that the division above has time to finish: dependent steps limit
        // the speed of this algorithm.
        let t = hinges.translation(step, index);
        let ([column_moment, column_force, moment, force], j, m, h) = with_hinge!(hinges, *step, index, |hinge| {
            (
                [column.0, column.1, link.moment, link.force].map(|v| hinge.up(v)),
                hinge.up_symmetric(&j),
                hinge.up_symmetric(&m),
                hinge.up_matrix(&h),
            )
        });
        let column_moment = t.cross_add(column_force, column_moment);
        let moment = t.cross_add(force, moment);
        // To the parent's origin: with T = [t]× the blocks become M' = M, H' = H + T M, J' = J + T Hᵀ + H Tᵀ + T M Tᵀ
        // = J + T Hᵀ - H' T (T is skew).
        let h_new = h + cross_columns(t, &symmetric(&m));
        let left = cross_columns(t, &h.transpose());
        // H' T row by row: (row)ᵀ T = -(t × row)ᵀ, so - H' T has rows t × row.
        let right = [t.cross(Vec3(h_new.0[0])), t.cross(Vec3(h_new.0[1])), t.cross(Vec3(h_new.0[2]))];
        let entry = |k: usize, a: usize, b: usize| j[k] + left.0[a][b] + right[a][b];
        let moved = [entry(0, 0, 0), entry(1, 0, 1), entry(2, 0, 2), entry(3, 1, 1), entry(4, 1, 2), entry(5, 2, 2)];

        own.column = (column_moment, column_force);
        let share = own.rest_torque * own.inverse_inertia;
        let parent_link = &mut inner[parent];
        parent_link.force += column_force.scale_add(share, force);
        parent_link.moment += column_moment.scale_add(share, moment);
        let (moment, force) = (column_moment.scale(own.inverse_inertia), column_force.scale(own.inverse_inertia));
        let parent = &mut inner_inertias[parent];
        for k in 0..6 {
            parent.rotation[k] += moved[k];
            parent.mass[k] += m[k];
        }
        subtract_outer(&mut parent.rotation, column_moment, moment);
        subtract_outer(&mut parent.mass, column_force, force);
        for i in 0..3 {
            for k in 0..3 {
                let entry = &mut parent.coupling.0[i][k];
                *entry = moment[i].neg_mul_add(column_force[k], *entry + h_new.0[i][k]);
            }
        }
    }
    joint_accelerations(steps, hinges, articulated, motions, ddq);
}

/// Outward: joint accelerations and their contributions to the bodies' accelerations.
#[inline(always)]
fn joint_accelerations<T: Scalar>(
    steps: &[JointStep],
    hinges: PlacedHinges<'_, T>,
    articulated: &[ArticulatedInertia<T>],
    motions: &mut [LinkMotion<T>],
    ddq: &mut [T],
) {
    let joints = steps.len();
    let (articulated, motions, ddq) = (&articulated[..joints], &mut motions[..joints], &mut ddq[..joints]);
    for index in 0..joints {
        let step = &steps[index];
        let own = &articulated[index];
        let (inner, outer) = motions.split_at_mut(index);
        let link = &mut outer[0];
        let (mut alpha, mut acceleration, pull) = if let Some(parent) = step.parent {
            let parent = &inner[parent];
            let origin = parent.alpha.cross_add(hinges.translation(step, index), parent.acceleration);
            let (alpha, acceleration) =
                with_hinge!(hinges, *step, index, |hinge| (hinge.down(parent.alpha), hinge.down(origin)));
            (alpha, acceleration, own.column.0.dot(parent.alpha) + own.column.1.dot(parent.acceleration))
        } else {
            (Vec3::ZERO, Vec3::ZERO, T::ZERO)
        };
        ddq[index] = (own.rest_torque - pull) * own.inverse_inertia;
        // From here on alpha and acceleration contain the contributions of the joint accelerations only.
        let along = if step.is_rotary { &mut alpha } else { &mut acceleration };
        along.0[2] += ddq[index];
        (link.alpha, link.acceleration) = (alpha, acceleration);
    }
}
