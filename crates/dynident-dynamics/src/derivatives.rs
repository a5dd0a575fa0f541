//! Analytic derivatives of the inverse dynamics.

use crate::ground::{MassMoments, MomentRates, Spatial};
use crate::states::VariedBody;
use crate::tree_scratch::TreeScratch;
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::{Model, Transform, Vec3};

/// Derivatives of the joint torques, row-major, dof × dof: row = torque, column = what it is derived by.
#[derive(Clone, Copy, Debug)]
pub struct InverseDynamicsDerivatives<'w> {
    /// `∂τ/∂q`.
    pub by_position: &'w [f64],
    /// `∂τ/∂q̇`.
    pub by_velocity: &'w [f64],
    /// `∂τ/∂q̈`, the mass matrix.
    pub by_acceleration: &'w [f64],
}

/// Derivatives of [`inverse_dynamics`](crate::inverse_dynamics()) by position, velocity and acceleration, without
/// differences.
///
/// Tangent recursion: for every joint the variation of the Newton-Euler recursion runs over the joint's own subtree
/// outward and over the path to the base inward (Carpentier and Mansard, *Analytical derivatives of rigid body dynamics
/// algorithms*, RSS 2018, in body frames). A variation of `q_j` turns or slides frame `j` against its parent; its whole
/// effect on the subtree is the change of the motion that arrives there. Allocation-free.
///
/// # Panics
/// If a vector's length is not the number of joints, or the workspace was made for another size.
#[doc(alias("jacobian", "rnea derivatives"))]
pub fn inverse_dynamics_derivatives<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    ddq: &[f64],
) -> InverseDynamicsDerivatives<'w> {
    workspace.check(model, &[q, dq, ddq]);
    let Workspace { level, scratch, matrices, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, dq, ddq);
        let TreeScratch { q, dq, ddq, matrices: [by_position, by_velocity, by_acceleration], .. } = tree;
        dispatch_single(*level, Single { model, scratch, q, dq, ddq, by_position, by_velocity, by_acceleration });
        for (to, from) in matrices.iter_mut().zip(&tree.matrices) {
            coupling.project_matrix(from, to);
        }
        let [by_position, by_velocity, by_acceleration] = matrices;
        return InverseDynamicsDerivatives { by_position, by_velocity, by_acceleration };
    }
    let [by_position, by_velocity, by_acceleration] = matrices;
    dispatch_single(*level, Single { model, scratch, q, dq, ddq, by_position, by_velocity, by_acceleration });
    InverseDynamicsDerivatives { by_position, by_velocity, by_acceleration }
}

one_sample_kernel!((q, dq, ddq), newton_euler_derivatives, by_position: matrices[0], by_velocity: matrices[1], by_acceleration: matrices[2]);

/// From `q`, `dq`, `ddq` of the scratch to its three matrices.
#[inline(always)]
pub(crate) fn newton_euler_derivatives<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    scratch.place(model.maps());
    outward(model, scratch);
    inward(model, scratch);
}

/// Axes, their rates, and what every body alone contributes.
#[inline(always)]
fn outward<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let base = VariedBody { acceleration: Spatial { angular: Vec3::ZERO, linear: (-model.gravity()).splat() }, ..VariedBody::REST };
    for (index, map) in model.maps().iter().enumerate() {
        let (inner, outer) = scratch.varied.split_at_mut(index);
        let parent = map.parent.map_or(&base, |parent| &inner[parent]);
        let body = &mut outer[0];
        let own = &scratch.bodies[index].parent_from_body;
        body.placement = if map.parent.is_some() { parent.placement.then(own) } else { *own };
        let Transform { rotation, translation } = &body.placement;
        let (dq, ddq) = (scratch.dq[index], scratch.ddq[index]);

        let axis = Spatial::axis(map.turns, rotation.mul_vec(map.axis.splat()), *translation);
        // The parent's velocity and the body's own move the axis alike: S × S = 0.
        let rate = parent.velocity.cross(&axis);
        body.velocity = axis.scale_add(dq, &parent.velocity);
        body.acceleration = axis.scale_add(ddq, &rate.scale_add(dq, &parent.acceleration));
        body.second_rate = parent.acceleration.cross_add(&axis, &parent.velocity.cross(&rate));
        body.axis = axis;
        body.twice_rate = Spatial { angular: rate.angular + rate.angular, linear: rate.linear + rate.linear };

        body.moments = MassMoments::of(&model.inertials()[index], &body.placement);
        body.rates = MomentRates::of(&body.moments, &body.velocity);
        let inertial = body.moments.times(&body.acceleration);
        body.wrench = body.velocity.cross_dual_add(&body.rates.spatial_momentum(), &inertial);
    }
}

/// From the tips to the base: what hangs on a joint against all axes on the way to it.
#[inline(always)]
fn inward<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let (maps, dof) = (model.maps(), model.body_count());
    let CoreScratch { varied, matrices: [by_position, by_velocity, by_acceleration], .. } = scratch;
    // Joints on different branches do not meet; every entry along a path is written below.
    for matrix in [&mut *by_position, by_velocity, by_acceleration] {
        matrix.fill(T::ZERO);
    }
    for index in (0..dof).rev() {
        let (inner, outer) = varied.split_at_mut(index);
        let body = &outer[0];
        let VariedBody { axis, twice_rate, second_rate, moments, rates, wrench, .. } = body;
        let held = axis.cross_dual_add(wrench, &Spatial::ZERO);
        let column_by_position = rates.coriolis_add(twice_rate.angular, &moments.times_add(second_rate, &held));
        let column_by_velocity =
            rates.coriolis_add(axis.angular + axis.angular, &moments.times(twice_rate));
        let column_by_acceleration = moments.times(axis);
        let row = rates.coriolis_transposed(axis);
        let twice_row = row + row;

        by_position[index * dof + index] = axis.dot(&column_by_position);
        by_velocity[index * dof + index] = axis.dot(&column_by_velocity);
        by_acceleration[index * dof + index] = axis.dot(&column_by_acceleration);
        let mut link = maps[index].parent;
        while let Some(at) = link {
            let above = &inner[at];
            let (lower, upper) = (index * dof + at, at * dof + index);
            by_position[upper] = above.axis.dot(&column_by_position);
            by_velocity[upper] = above.axis.dot(&column_by_velocity);
            let inertia = above.axis.dot(&column_by_acceleration);
            by_acceleration[upper] = inertia;
            by_acceleration[lower] = inertia;
            by_position[lower] = above.twice_rate.angular.dot(row) + above.second_rate.dot(&column_by_acceleration);
            by_velocity[lower] = above.axis.angular.dot(twice_row) + above.twice_rate.dot(&column_by_acceleration);
            link = maps[at].parent;
        }
        if let Some(parent) = maps[index].parent {
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

    /// Torques as dual numbers: the oracle, through the inverse dynamics only.
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
        crate::inverse_dynamics::newton_euler(model, &mut scratch);
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
