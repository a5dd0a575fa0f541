//! Inverse dynamics: the recursive Newton-Euler algorithm.

use crate::hinge::{Hinge, PlacedHinges, cross_shift, times_shift, with_hinge};
use crate::sample_lanes::{put_lanes, take_lanes};
use crate::states::{LinkMotion, LinkWrench};
use crate::tree_scratch::{TreeBatch, TreeScratch, expanded};
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch, Workspace, one_sample_kernel};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch, dispatch_single};
use dynident_model::terms::JointMotion;
use dynident_model::{JointStep, Mat3, Model, Vec3};

/// Computes the joint torques `τ = M(q) q̈ + C(q, q̇) q̇ + g(q)` of the rigid bodies with the model's inertial
/// parameters, without friction and drives. One entry per joint: Nm for revolute joints, N for prismatic ones.
///
/// Recursive Newton-Euler: Luh, Walker and Paul (1980); Featherstone, *Rigid Body Dynamics Algorithms* (2008), section
/// 5.3; over the model's inner frames ([`JointStep`]). Allocation-free. Bodies without a prior are treated as
/// massless: see [`Model::bodies_without_prior`].
///
/// ```
/// # use dynident_model::{Body, Joint, JointKind, JointLimits, InertialParameters, Link, Mat3, Model, Transform, Vec3};
/// # let link = |name: &str, inertial| Link { name: name.into(), placement: Transform::IDENTITY, inertial, collision: vec![] };
/// # let rod = InertialParameters::from_centre_of_mass(2.0, Vec3([0.5, 0.0, 0.0]), &Mat3::ZERO);
/// # let joint = Joint { name: "hinge".into(), kind: JointKind::Continuous, parent: None, placement: Transform::IDENTITY,
/// #     axis: Vec3([0.0, 1.0, 0.0]), limits: JointLimits::default(), damping: None, friction: None,
/// #     drive_inertia: None, spring: None, mimic: None };
/// # let model = Model::new("pendulum", Body { links: vec![link("base", None)] }, vec![joint],
/// #     vec![Body { links: vec![link("bob", Some(rod))] }]).unwrap();
/// use dynident_dynamics::{Workspace, inverse_dynamics};
/// let mut workspace = Workspace::new(&model);
/// // A point mass of 2 kg at 0.5 m from a horizontal hinge: the torque is m g l.
/// let tau = inverse_dynamics(&model, &mut workspace, &[0.0], &[0.0], &[0.0]);
/// assert!((tau[0] + 2.0 * 9.81 * 0.5).abs() < 1e-12);
/// ```
///
/// # Panics
/// If a vector's length is not the number of joints, or for a workspace of another size.
#[doc(alias("rnea", "newton-euler", "id"))]
pub fn inverse_dynamics<'w>(
    model: &Model,
    workspace: &'w mut Workspace,
    q: &[f64],
    dq: &[f64],
    ddq: &[f64],
) -> &'w [f64] {
    workspace.check(model, &[q, dq, ddq]);
    let Workspace { level, scratch, vector, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        tree.take_motion(coupling, q, dq, ddq);
        let TreeScratch { q, dq, ddq, tau, .. } = tree;
        dispatch_single(*level, Single { model, scratch, q, dq, ddq, tau });
        vector.fill(0.0);
        coupling.add_projected(tau, 1, vector);
    } else {
        dispatch_single(*level, Single { model, scratch, q, dq, ddq, tau: vector });
    }
    vector
}

/// Computes [`inverse_dynamics`] of every sample: `tau[joint * samples + sample]`, joint-major like the motion.
///
/// # Panics
/// If an array's length is not joints × samples, or for a workspace of another size.
#[doc(alias("rnea"))]
pub fn inverse_dynamics_batch(
    model: &Model,
    workspace: &mut BatchWorkspace,
    motion: &JointMotion<'_>,
    tau: &mut [f64],
) {
    workspace.check(model, motion.samples, &[motion.q, motion.dq, motion.ddq, tau]);
    let BatchWorkspace { level, scratch, tree, .. } = workspace;
    if let Some(coupling) = model.coupling() {
        let TreeBatch { motion: tree_motion, results: [tree_tau, ..], .. } = tree;
        let motion = &expanded(coupling, motion, tree_motion);
        tree_tau.clear();
        tree_tau.resize(motion.q.len(), 0.0);
        dispatch(*level, Batch { model, scratch, motion, tau: tree_tau });
        tau.fill(0.0);
        coupling.add_projected(tree_tau, motion.samples, tau);
    } else {
        dispatch(*level, Batch { model, scratch, motion, tau });
    }
}

one_sample_kernel!((q, dq, ddq), newton_euler, tau: tau);

struct Batch<'a> {
    model: &'a Model,
    scratch: &'a mut AnyScratch,
    motion: &'a JointMotion<'a>,
    tau: &'a mut [f64],
}

impl Kernel for Batch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<T: Lane>(self) {
        let scratch = &mut self.scratch.of::<T>().core;
        let samples = self.motion.samples;
        for at in (0..samples).step_by(T::LANES) {
            take_lanes(&mut scratch.q, self.motion.q, samples, at);
            take_lanes(&mut scratch.dq, self.motion.dq, samples, at);
            take_lanes(&mut scratch.ddq, self.motion.ddq, samples, at);
            newton_euler(self.model, scratch);
            for (joint, value) in scratch.tau.iter().enumerate() {
                put_lanes(*value, &mut self.tau[joint * samples..(joint + 1) * samples], at);
            }
        }
    }
}

/// Computes `tau` of the scratch from its `q`, `dq`, `ddq`.
#[inline(always)]
pub(crate) fn newton_euler<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    scratch.hinges.place(model.steps(), &scratch.q);
    newton_euler_placed(model, scratch);
}

/// Like [`newton_euler`], with hinges that are already placed.
#[inline(always)]
pub(crate) fn newton_euler_placed<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let steps = model.steps();
    let joints = steps.len();
    let hinges = scratch.hinges.placed(joints);
    let (motions, wrenches) = (&mut scratch.motions[..joints], &mut scratch.wrenches[..joints]);
    outward(model, hinges, motions, wrenches, &scratch.dq[..joints], &scratch.ddq[..joints]);
    let tau = &mut scratch.tau[..joints];
    // Wrench on the next body if it is a child of this one; stays in registers.
    let mut next = LinkWrench::ZERO;
    for index in (0..joints).rev() {
        let step = &steps[index];
        let (inner, outer) = wrenches.split_at_mut(index);
        let wrench = &outer[0];
        let (force, moment) = (wrench.force + next.force, wrench.moment + next.moment);
        tau[index] = if step.is_rotary { moment[2] } else { force[2] };
        next = LinkWrench::ZERO;
        let Some(parent) = step.parent else { continue };
        let (force, moment) = with_hinge!(hinges, *step, index, |hinge| (hinge.up(force), hinge.up(moment)));
        let translation = hinges.translation(step, index);
        if step.hang.on_resting_axis {
            let about = cross_shift(step.shift, translation, force, moment)[2];
            if step.hang.follows {
                next.moment.0[2] = about;
            } else {
                inner[parent].moment.0[2] += about;
            }
            continue;
        }
        let moment = cross_shift(step.shift, translation, force, moment);
        if step.hang.follows {
            next = LinkWrench { force, moment };
        } else {
            inner[parent].force += force;
            inner[parent].moment += moment;
        }
    }
}

/// Outward recursion: motion of every body and the wrench that moves this body alone.
#[inline(always)]
pub(crate) fn outward<T: Scalar>(
    model: &Model,
    hinges: PlacedHinges<'_, T>,
    motions: &mut [LinkMotion<T>],
    wrenches: &mut [LinkWrench<T>],
    dq: &[T],
    ddq: &[T],
) {
    let joints = motions.len();
    let (steps, wrenches, dq, ddq) = (&model.steps()[..joints], &mut wrenches[..joints], &dq[..joints], &ddq[..joints]);
    let base = LinkMotion { acceleration: (-model.gravity()).splat(), ..LinkMotion::REST };
    // Motion of the previous body: along a chain it stays in registers.
    let mut motion = base;
    for index in 0..joints {
        let step = &steps[index];
        match step.parent {
            None if step.is_rotary => {
                let arriving = with_hinge!(hinges, *step, index, |hinge| hinge.down(base.acceleration));
                (motion, wrenches[index]) = about_resting_axis(step, arriving, dq[index], ddq[index]);
            }
            parent => {
                if !step.hang.follows {
                    motion = parent.map_or(base, |parent| motions[parent]);
                }
                let translation = hinges.translation(step, index);
                let origin = times_shift(step.shift, translation, &motion.spin, motion.acceleration);
                let arriving = with_hinge!(hinges, *step, index, |hinge| {
                    [hinge.down(motion.omega), hinge.down(motion.alpha), hinge.down(origin)]
                });
                motion = moved(step, arriving, dq[index], ddq[index]);
                wrenches[index] = wrench(step, &motion);
            }
        }
        if step.branches {
            motions[index] = motion;
        }
    }
}

/// A body that rotates about an axis at rest. Computes its motion from the acceleration minus gravity in its frame,
/// and the only relevant part of its wrench, the moment about the axis.
#[inline(always)]
fn about_resting_axis<T: Scalar>(
    step: &JointStep,
    acceleration: Vec3<T>,
    dq: T,
    ddq: T,
) -> (LinkMotion<T>, LinkWrench<T>) {
    let about = |rate: T| Vec3([T::ZERO, T::ZERO, rate]);
    let inward = -(dq * dq);
    let spin = Mat3([[inward, -ddq, T::ZERO], [ddq, inward, T::ZERO], [T::ZERO; 3]]);
    let ([hx, hy, _], [xx, _, _, yy, ..]) = (step.first.splat::<T>().0, step.second.map(T::splat));
    let moment = hx.mul_add(acceleration[1], hy.neg_mul_add(acceleration[0], (xx + yy) * ddq));
    let motion = LinkMotion { omega: about(dq), alpha: about(ddq), acceleration, spin };
    (motion, LinkWrench { force: Vec3::ZERO, moment: about(moment) })
}

/// One step outward, from angular velocity, angular acceleration and acceleration of the parent in this frame. A point
/// `x` of a body has the acceleration `a + Γ x` with `Γ = [α]× + [ω]× [ω]×`.
#[inline(always)]
fn moved<T: Scalar>(step: &JointStep, arriving: [Vec3<T>; 3], dq: T, ddq: T) -> LinkMotion<T> {
    let [mut omega, mut alpha, mut acceleration] = arriving;
    let [wx, wy, _] = omega.0;
    if step.is_rotary {
        // ω × z q̇
        alpha = Vec3([wy.mul_add(dq, alpha[0]), wx.neg_mul_add(dq, alpha[1]), alpha[2] + ddq]);
        omega.0[2] += dq;
    } else {
        let twice = dq + dq;
        let [x, y, z] = acceleration.0;
        acceleration = Vec3([wy.mul_add(twice, x), wx.neg_mul_add(twice, y), z + ddq]);
    }
    let ([wx, wy, wz], [ax, ay, az]) = (omega.0, alpha.0);
    let (xx, yy, zz) = (wx * wx, wy * wy, wz * wz);
    let spin = Mat3([
        [-(yy + zz), wx.mul_add(wy, -az), wx.mul_add(wz, ay)],
        [wx.mul_add(wy, az), -(xx + zz), wy.mul_add(wz, -ax)],
        [wx.mul_add(wz, -ay), wy.mul_add(wz, ax), -(xx + yy)],
    ]);
    LinkMotion { omega, alpha, acceleration, spin }
}

/// Wrench of a body: `f = m a + Γ h` and, about the frame's origin, `n = h × a + ∫ x × Γ x dm`, whose x entry is `Γ_z
/// Σ_y - Γ_y Σ_z` (y and z likewise) with the rows of Γ and Σ. Differences of Γ's diagonal entries are computed as
/// sums that need no products.
#[inline(always)]
fn wrench<T: Scalar>(step: &JointStep, motion: &LinkMotion<T>) -> LinkWrench<T> {
    let g = &motion.spin.0;
    let [ax, ay, az] = motion.acceleration.0;
    let [hx, hy, hz] = step.first.splat::<T>().0;
    let [xx, xy, xz, yy, yz, zz] = step.second.map(T::splat);
    let (x, y, z) = (g[2][2] - g[1][1], g[0][0] - g[2][2], g[1][1] - g[0][0]);
    // Revolute bodies have no mass and no first and second moments along the axis: see JointStep.
    let mut f =
        Vec3([g[0][1].mul_add(hy, g[0][0] * hx), g[1][1].mul_add(hy, g[1][0] * hx), g[2][1].mul_add(hy, g[2][0] * hx)]);
    let mut n = Vec3([hy * az, -(hx * az), hx.mul_add(ay, -(hy * ax))]);
    n.0[0] = g[2][1].mul_add(yy, g[2][0].mul_add(xy, g[1][0].neg_mul_add(xz, x.mul_add(yz, n[0]))));
    n.0[1] = g[2][1].neg_mul_add(xy, g[2][0].neg_mul_add(xx, g[0][1].mul_add(yz, y.mul_add(xz, n[1]))));
    n.0[2] = g[1][2].mul_add(xz, g[1][0].mul_add(xx, z.mul_add(xy, n[2])));
    n.0[2] = g[0][2].neg_mul_add(yz, g[0][1].neg_mul_add(yy, n[2]));
    if !step.is_rotary {
        let along = Vec3([g[0][2], g[1][2], g[2][2]]);
        f = motion.acceleration.scale_add(T::splat(step.mass), along.scale_add(hz, f));
        n.0[0] = g[1][2].neg_mul_add(zz, hz.neg_mul_add(ay, n[0]));
        n.0[1] = g[0][2].mul_add(zz, hz.mul_add(ax, n[1]));
    }
    LinkWrench { force: f, moment: n }
}
