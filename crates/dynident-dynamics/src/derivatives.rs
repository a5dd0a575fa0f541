//! Analytic derivatives of the inverse dynamics.

use crate::ground::Spatial;
use crate::joint_matrices::{JointMatrices, MatrixRows};
use crate::sample_lanes::take_lanes;
use crate::tree_scratch::{TreeBatch, TreeScratch, expanded, project_matrices};
use crate::varied_body::VariedBody;
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch, Workspace};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch, dispatch_single};
use dynident_model::terms::JointMotion;
use dynident_model::{Model, Vec3};

/// Derivatives of the joint torques, row-major, dof × dof: row = torque, column = variable.
#[derive(Clone, Copy, Debug)]
pub struct InverseDynamicsDerivatives<'w> {
    /// `∂τ/∂q`.
    pub by_position: &'w [f64],
    /// `∂τ/∂q̇`.
    pub by_velocity: &'w [f64],
    /// `∂τ/∂q̈`, the mass matrix.
    pub by_acceleration: &'w [f64],
}

/// Computes the analytic derivatives of [`inverse_dynamics`](crate::inverse_dynamics()) with respect to position,
/// velocity and acceleration.
///
/// Axes `S`, their rates `Ψ̇ = v × S`, `Ψ̈ = a × S + v × Ψ̇` and inertias are all in the base frame. The inertia `I`,
/// Coriolis matrix `B` and wrench `f` of a subtree are sums over its bodies. For a joint `i` on the path from the
/// base to `j`
///
/// ```text
/// ∂τ_i/∂q_j = S_i · (2 B_j Ψ̇_j + I_j Ψ̈_j + S_j ×* f_j)      ∂τ_j/∂q_i = 2 Ψ̇_i · (B_jᵀ S_j) + Ψ̈_i · (I_j S_j)
/// ∂τ_i/∂q̇_j = S_i · (2 B_j S_j + 2 I_j Ψ̇_j)                 ∂τ_j/∂q̇_i = 2 S_i · (B_jᵀ S_j) + 2 Ψ̇_i · (I_j S_j)
/// ```
///
/// with `a` minus gravity: Singh, Russell and Wensing, *Efficient analytical derivatives of rigid-body dynamics using
/// spatial vector algebra*, RA-L 2022. O(n · depth), allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another tree.
#[doc(alias("jacobian", "rnea derivatives"))]
pub fn inverse_dynamics_derivatives<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    ddq: &[f64],
) -> InverseDynamicsDerivatives<'w> {
    workspace.check(model, &[q, dq, ddq]);
    workspace.check_tree(model);
    let Workspace { level, scratch, matrices, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, dq, ddq);
        let TreeScratch { q, dq, ddq, matrices: tree_matrices, .. } = tree;
        let motion = &JointMotion { samples: 1, q, dq, ddq };
        let out = tree_matrices.each_mut().map(|out| MatrixRows { out, stride: 1 });
        dispatch_single(*level, Fill { model, scratch, motion, out });
        for (to, from) in matrices.iter_mut().zip(tree_matrices) {
            coupling.project_matrix(from, to);
        }
    } else {
        let motion = &JointMotion { samples: 1, q, dq, ddq };
        // Entries of joints on different branches are never written and remain zero.
        let out = matrices.each_mut().map(|out| MatrixRows { out, stride: 1 });
        dispatch_single(*level, Fill { model, scratch, motion, out });
    }
    let [by_position, by_velocity, by_acceleration] = matrices;
    InverseDynamicsDerivatives { by_position, by_velocity, by_acceleration }
}

/// Derivatives of several samples: entry `(i, k)` of sample `s` is at `[(i * dof + k) * samples + s]`.
/// Computes [`inverse_dynamics_derivatives`] of every sample of a motion with respect to position, velocity and
/// acceleration (in this order). Entries of joints on different branches stay zero.
///
/// Allocation-free once the arrays have grown to the number of samples, except for robots with coupled joints.
///
/// # Panics
/// If an array of the motion does not have joints × samples values, or for a workspace or matrices of another tree.
#[doc(alias("rnea derivatives"))]
pub fn inverse_dynamics_derivative_matrices(
    model: &Model,
    workspace: &mut BatchWorkspace,
    motion: &JointMotion<'_>,
    out: &mut [JointMatrices; 3],
) {
    workspace.check(model, motion.samples, &[motion.q, motion.dq, motion.ddq]);
    let out = out.each_mut().map(|out| out.resize(model, motion.samples));
    fill(model, workspace, motion, out);
}

/// Writes the entries of all pairs of joints on a common path to the base.
fn fill(model: &Model, workspace: &mut BatchWorkspace, motion: &JointMotion<'_>, mut out: [MatrixRows<'_>; 3]) {
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    let Some(coupling) = model.coupling() else {
        dispatch(*level, Fill { model, scratch, motion, out });
        return;
    };
    let TreeBatch { motion: tree_motion, matrices, .. } = tree;
    let motion = &expanded(coupling, motion, tree_motion);
    for matrix in matrices.iter_mut() {
        matrix.resize(coupling.joints() * motion.q.len(), 0.0);
    }
    let mut rows = matrices.each_mut().map(|out| MatrixRows { out, stride: motion.samples });
    for rows in &mut rows {
        rows.clear_across_branches(model);
    }
    dispatch(*level, Fill { model, scratch, motion, out: rows });
    for (to, from) in out.iter_mut().zip(matrices) {
        project_matrices(coupling, from, motion.samples, to);
    }
}

struct Fill<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    motion: &'a JointMotion<'a>,
    out: [MatrixRows<'a>; 3],
}

impl Kernel for Fill<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let Self { model, scratch, motion, mut out } = self;
        let core = &mut scratch.of::<T>().core;
        let samples = motion.samples;
        for at in (0..samples).step_by(T::LANES) {
            take_lanes(&mut core.q, motion.q, samples, at);
            take_lanes(&mut core.dq, motion.dq, samples, at);
            take_lanes(&mut core.ddq, motion.ddq, samples, at);
            core.hinges.place(model.steps(), &core.q);
            outward(model, core);
            inward(model, core, &mut out, at);
        }
    }
}

/// Axes, their rates, and the contribution of every single body.
#[inline(always)]
fn outward<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let steps = model.steps();
    let joints = steps.len();
    let hinges = scratch.hinges.placed(joints);
    let varied = &mut scratch.varied[..joints];
    let (dq, ddq) = (&scratch.dq[..joints], &scratch.ddq[..joints]);
    let gravity = Spatial { angular: Vec3::ZERO, linear: (-model.gravity()).splat() };
    let base = VariedBody { acceleration: gravity, ..VariedBody::REST };
    for index in 0..joints {
        let step = &steps[index];
        let (inner, outer) = varied.split_at_mut(index);
        let parent = step.parent.map_or(&base, |parent| &inner[parent]);
        let body = &mut outer[0];
        body.follow(parent, step, index, &hinges);
        let rate = body.move_along(parent, dq[index]);
        body.acceleration = body.axis.scale_add(ddq[index], &rate.scale_add(dq[index], &parent.acceleration));
        body.second_rate = parent.acceleration.cross_add(&body.axis, &parent.velocity.cross(&rate));
        let inertial = body.moments.times(&body.acceleration);
        body.wrench = body.velocity.cross_dual_add(&body.rates.spatial_momentum(), &inertial);
    }
}

/// Inward: products of each subtree with all axes on the path to it.
#[inline(always)]
fn inward<T: Lane>(model: &Model, scratch: &mut CoreScratch<T>, out: &mut [MatrixRows<'_>; 3], sample: usize) {
    let steps = model.steps();
    let dof = steps.len();
    let varied = &mut scratch.varied[..dof];
    let [by_position, by_velocity, by_acceleration] = out;
    for index in (0..dof).rev() {
        let (inner, outer) = varied.split_at_mut(index);
        let body = &outer[0];
        let VariedBody { axis, twice_rate, second_rate, moments, rates, wrench, .. } = body;
        let held = axis.cross_dual_add(wrench, &Spatial::ZERO);
        let column_by_position = rates.coriolis_add(twice_rate.angular, &moments.times_add(second_rate, &held));
        let column_by_velocity = rates.coriolis_add(axis.angular + axis.angular, &moments.times(twice_rate));
        let column_by_acceleration = moments.times(axis);
        let row = rates.coriolis_transposed(axis);
        let twice_row = row + row;

        let diagonal = index * dof + index;
        by_position.put(diagonal, sample, axis.dot(&column_by_position));
        by_velocity.put(diagonal, sample, axis.dot(&column_by_velocity));
        by_acceleration.put(diagonal, sample, axis.dot(&column_by_acceleration));
        let mut link = steps[index].parent;
        while let Some(at) = link {
            let above = &inner[at];
            let (lower, upper) = (index * dof + at, at * dof + index);
            by_position.put(upper, sample, above.axis.dot(&column_by_position));
            by_velocity.put(upper, sample, above.axis.dot(&column_by_velocity));
            let inertia = above.axis.dot(&column_by_acceleration);
            by_acceleration.put(upper, sample, inertia);
            by_acceleration.put(lower, sample, inertia);
            let turned = above.twice_rate.angular.dot(row);
            by_position.put(lower, sample, turned + above.second_rate.dot(&column_by_acceleration));
            let turned = above.axis.angular.dot(twice_row);
            by_velocity.put(lower, sample, turned + above.twice_rate.dot(&column_by_acceleration));
            link = steps[at].parent;
        }
        if let Some(parent) = steps[index].parent {
            let parent = &mut inner[parent];
            parent.moments += body.moments;
            parent.rates += body.rates;
            parent.wrench += body.wrench;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_lanes::Dual;
    use dynident_model::sample::{Random, random_tree};

    /// Oracle: inverse dynamics with dual numbers.
    fn dual_column(model: &Model, state: [&[f64]; 3], which: usize, joint: usize) -> Vec<f64> {
        let mut scratch = CoreScratch::<Dual>::new(model.body_count());
        for (k, values) in state.into_iter().enumerate() {
            let to = match k {
                0 => &mut scratch.q,
                1 => &mut scratch.dq,
                _ => &mut scratch.ddq,
            };
            for (index, (to, &value)) in to.iter_mut().zip(values).enumerate() {
                *to = if k == which && index == joint { Dual::variable(value) } else { Dual::constant(value) };
            }
        }
        crate::body_frames::newton_euler(model, &mut scratch);
        scratch.tau.iter().map(|tau| tau.derivative).collect()
    }

    #[test]
    fn hand_written_derivatives_equal_dual_numbers() {
        let mut random = Random::new(11);
        for seed in 0..40 {
            let dof = 1 + (seed as usize % 10);
            let model = random_tree(seed, dof);
            let mut vector = || (0..dof).map(|_| random.uniform(-2.0, 2.0)).collect::<Vec<f64>>();
            let (q, dq, ddq) = (vector(), vector(), vector());
            let mut workspace = Workspace::new(&model);
            let analytic = inverse_dynamics_derivatives(&model, &mut workspace, &q, &dq, &ddq);
            let matrices = [analytic.by_position, analytic.by_velocity, analytic.by_acceleration];
            for (which, matrix) in matrices.into_iter().enumerate() {
                let scale = matrix.iter().fold(1.0_f64, |a, x| a.max(x.abs()));
                for joint in 0..dof {
                    let expected = dual_column(&model, [&q, &dq, &ddq], which, joint);
                    for row in 0..dof {
                        // Two orders of summation in double precision over ten bodies.
                        let error = (matrix[row * dof + joint] - expected[row]).abs();
                        assert!(error <= 1e-12 * scale, "seed {seed}, matrix {which}, ({row}, {joint}): {error:e}");
                    }
                }
            }
        }
    }
}
