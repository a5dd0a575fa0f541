//! Analytic derivatives of the inverse dynamics.

use crate::composite::Composite;
use crate::states::{BodyDerivative, BodyState};
use crate::tree_scratch::TreeScratch;
use crate::workspace::{CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Scalar, dispatch_single};
use dynident_model::{InertialParameters, Model, Transform, Vec3};

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

#[derive(Clone, Copy, PartialEq)]
enum DerivativeBy {
    Position,
    Velocity,
}

/// From `q`, `dq`, `ddq` of the scratch to its three matrices.
#[inline(always)]
pub(crate) fn newton_euler_derivatives<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    crate::mass_matrix::composite_rigid_bodies(model, scratch);
    scratch.matrices.swap(0, 2);
    crate::inverse_dynamics::newton_euler(model, scratch);
    for (slot, by) in [DerivativeBy::Position, DerivativeBy::Velocity].into_iter().enumerate() {
        scratch.matrices[slot].fill(T::ZERO);
        for joint in 0..model.body_count() {
            vary(model, scratch, joint, by, slot);
        }
    }
}

/// One column of one derivative matrix.
#[inline(always)]
fn vary<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>, joint: usize, by: DerivativeBy, slot: usize) {
    let (maps, dof) = (model.maps(), model.body_count());
    let CoreScratch { bodies, derivative, matrices, dq, .. } = scratch;
    // Outward: children of a varied body stand after it, so one sweep from `joint` reaches the subtree.
    for index in joint..dof {
        let map = &maps[index];
        let varied_parent = map.parent.is_some_and(|parent| parent >= joint && is_below(model, joint, parent));
        if index != joint && !varied_parent {
            derivative[index] = BodyDerivative::ZERO;
            continue;
        }
        let body = &bodies[index];
        let Transform { rotation, translation } = &body.parent_from_body;
        let axis = map.axis.splat::<T>();
        let own = axis.scale(dq[index]);
        let mut d = if index == joint {
            own_variation(model, bodies, index, axis, own, by)
        } else {
            let parent = map.parent.unwrap_or(0);
            let (base, moved) = (&bodies[parent], &derivative[parent]);
            let swing = moved.alpha.cross_add(
                *translation,
                moved.omega.cross_add(
                    base.omega.cross(*translation),
                    base.omega.cross_add(moved.omega.cross(*translation), moved.acceleration),
                ),
            );
            let omega = rotation.transpose_mul_vec(moved.omega);
            let alpha = rotation.transpose_mul_vec(moved.alpha);
            let acceleration = rotation.transpose_mul_vec(swing);
            if map.turns {
                BodyDerivative { omega, alpha: omega.cross_add(own, alpha), acceleration, ..BodyDerivative::ZERO }
            } else {
                let coriolis = omega.cross(own);
                BodyDerivative {
                    omega,
                    alpha,
                    acceleration: acceleration + coriolis + coriolis,
                    ..BodyDerivative::ZERO
                }
            }
        };
        (d.force, d.moment) = wrench_variation(&model.inertials()[index], body.omega, &d);
        derivative[index] = d;
    }
    // Inward over the subtree, then on along the path to the base.
    for index in (joint..dof).rev() {
        if index != joint && !is_below(model, joint, index) {
            continue;
        }
        let d = derivative[index];
        let map = &maps[index];
        matrices[slot][index * dof + joint] = map.axis.splat::<T>().dot(if map.turns { d.moment } else { d.force });
        if index == joint {
            break;
        }
        if let Some(parent) = map.parent {
            let Transform { rotation, translation } = bodies[index].parent_from_body;
            let force = rotation.mul_vec(d.force);
            derivative[parent].force += force;
            derivative[parent].moment =
                rotation.mul_vec_add(d.moment, translation.cross_add(force, derivative[parent].moment));
        }
    }
    let (mut force, mut moment) = (derivative[joint].force, derivative[joint].moment);
    let map = &maps[joint];
    let axis = map.axis.splat::<T>();
    let mut slide = Vec3::ZERO;
    if by == DerivativeBy::Position {
        // The parent sees the child's wrench turned (or carried) by the joint as well.
        let body = &bodies[joint];
        if map.turns {
            force += axis.cross(body.force);
            moment += axis.cross(body.moment);
        } else {
            slide = map.slide.splat::<T>().cross(body.parent_from_body.rotation.mul_vec(body.force));
        }
    }
    let mut at = joint;
    while let Some(parent) = maps[at].parent {
        let Transform { rotation, translation } = bodies[at].parent_from_body;
        force = rotation.mul_vec(force);
        moment = rotation.mul_vec_add(moment, translation.cross_add(force, slide));
        slide = Vec3::ZERO;
        let along: Vec3<T> = maps[parent].axis.splat();
        matrices[slot][parent * dof + joint] = along.dot(if maps[parent].turns { moment } else { force });
        at = parent;
    }
}

/// True when body `index` moves with `joint` (indices ascend from parent to child).
#[inline(always)]
fn is_below(model: &Model, joint: usize, index: usize) -> bool {
    let mut at = index;
    while at > joint {
        match model.maps()[at].parent {
            Some(parent) => at = parent,
            None => return false,
        }
    }
    at == joint
}

/// Variation of body `index`'s motion by its own joint's variable.
#[inline(always)]
fn own_variation<T: Scalar>(
    model: &Model,
    bodies: &[BodyState<T>],
    index: usize,
    axis: Vec3<T>,
    own: Vec3<T>,
    by: DerivativeBy,
) -> BodyDerivative<T> {
    let map = &model.maps()[index];
    let body = &bodies[index];
    let zero = BodyDerivative::ZERO;
    // Angular velocity that arrives from the parent, in this body's frame.
    let arriving = if map.turns { body.omega - own } else { body.omega };
    match (by, map.turns) {
        (DerivativeBy::Velocity, true) => BodyDerivative { omega: axis, alpha: arriving.cross(axis), ..zero },
        (DerivativeBy::Velocity, false) => {
            let coriolis = arriving.cross(axis);
            BodyDerivative { acceleration: coriolis + coriolis, ..zero }
        }
        // Turning the frame by δq turns what arrives by -δq: δ(Rᵀ x) = -axis × Rᵀ x = Rᵀ x × axis.
        (DerivativeBy::Position, true) => {
            let omega = arriving.cross(axis);
            let arriving_alpha = body.alpha - arriving.cross(own);
            // alpha also holds axis · q̈, which axis × removes.
            let alpha = omega.cross_add(own, arriving_alpha.cross(axis));
            BodyDerivative { omega, alpha, acceleration: body.acceleration.cross(axis), ..zero }
        }
        // Sliding by δq moves the origin along the axis: δa = α × axis + ω × (ω × axis).
        (DerivativeBy::Position, false) => {
            let acceleration = body.omega.cross_add(body.omega.cross(axis), body.alpha.cross(axis));
            BodyDerivative { acceleration, ..zero }
        }
    }
}

/// Variation of the wrench `f = m a + α × h + ω × (ω × h)`, `n = I α + ω × I ω + h × a` by a variation of the motion.
#[inline(always)]
fn wrench_variation<T: Scalar>(
    inertial: &InertialParameters,
    omega: Vec3<T>,
    d: &BodyDerivative<T>,
) -> (Vec3<T>, Vec3<T>) {
    let body = Composite::of(inertial);
    let (h, inertia) = (body.first_moment, body.inertia_matrix());
    let force = d.omega.cross_add(
        omega.cross(h),
        omega.cross_add(d.omega.cross(h), d.alpha.cross_add(h, d.acceleration.scale(body.mass))),
    );
    let moment = d.omega.cross_add(
        inertia.mul_vec(omega),
        omega.cross_add(inertia.mul_vec(d.omega), inertia.mul_vec_add(d.alpha, h.cross(d.acceleration))),
    );
    (force, moment)
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
