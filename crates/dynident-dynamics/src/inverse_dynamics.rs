//! Inverse dynamics: the recursive Newton-Euler algorithm.

use crate::states::BodyState;
use crate::tree_scratch::{TreeBatch, TreeScratch, expanded};
use crate::workspace::{AnyScratch, BatchWorkspace, CoreScratch, Workspace, one_sample_kernel, put_lanes, take_lanes};
use dynident_lanes::{Kernel, Lane, Scalar, dispatch, dispatch_single};
use dynident_model::terms::JointMotion;
use dynident_model::{InertialParameters, JointMap, Mat3, Model, Transform, Vec3};

/// Joint torques `τ = M(q) q̈ + C(q, q̇) q̇ + g(q)` of the rigid bodies with the model's inertial parameters, without
/// friction and drives. One entry per joint: Nm for revolute joints, N for prismatic ones.
///
/// Recursive Newton-Euler: Luh, Walker and Paul (1980); Featherstone, *Rigid Body Dynamics Algorithms* (2008), section
/// 5.3. Allocation-free. Bodies without a prior count as massless: see [`Model::bodies_without_prior`].
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
/// // A point mass of 2 kg held out at 0.5 m about +y: gravity pulls with m g l, the hinge holds against it.
/// let tau = inverse_dynamics(&model, &mut workspace, &[0.0], &[0.0], &[0.0]);
/// assert!((tau[0] + 2.0 * 9.81 * 0.5).abs() < 1e-12);
/// ```
///
/// # Panics
/// If a vector's length is not the number of joints, or the workspace was made for another size.
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

/// [`inverse_dynamics`] of every sample: `tau[joint * samples + sample]`, joint-major as the motion.
///
/// # Panics
/// If an array's length is not joints × samples, or the workspace was made for another size.
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

/// The recursion over any scalar: from `q`, `dq`, `ddq` of the scratch to its `tau`.
#[inline(always)]
pub(crate) fn newton_euler<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    scratch.place(model.maps());
    newton_euler_placed(model, scratch);
}

/// The recursion with the transforms in place.
#[inline(always)]
pub(crate) fn newton_euler_placed<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let maps = model.maps();
    outward(model, scratch);
    let inertials = model.inertials();
    for (body, inertial) in scratch.bodies.iter_mut().zip(inertials) {
        let wrench = inertial_wrench(inertial, body.omega, body.alpha, body.acceleration);
        body.force = wrench.0;
        body.moment = wrench.1;
    }
    for index in (0..maps.len()).rev() {
        let (inner, outer) = scratch.bodies.split_at_mut(index);
        let body = &outer[0];
        let map = &maps[index];
        scratch.tau[index] = map.axis.splat().dot(if map.turns { body.moment } else { body.force });
        if let Some(parent) = map.parent {
            let Transform { rotation, translation } = &body.parent_from_body;
            let parent = &mut inner[parent];
            let force = rotation.mul_vec(body.force);
            parent.force += force;
            parent.moment = translation.cross_add(force, rotation.mul_vec_add(body.moment, parent.moment));
        }
    }
}

/// Outward recursion: angular velocity, angular acceleration and acceleration minus gravity of every body from `dq`,
/// `ddq` and the transforms.
#[inline(always)]
pub(crate) fn outward<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let gravity = -model.gravity();
    for (index, map) in model.maps().iter().enumerate() {
        let (inner, outer) = scratch.bodies.split_at_mut(index);
        let parent = map.parent.map(|parent| &inner[parent]);
        moved(map, parent, gravity, scratch.dq[index], scratch.ddq[index], &mut outer[0]);
    }
}

/// One step outward: the motion of a body from its parent's, at the transform that stands in `body`. `gravity` is the
/// base's acceleration against gravity.
#[inline(always)]
pub(crate) fn moved<T: Scalar>(
    map: &JointMap,
    parent: Option<&BodyState<T>>,
    gravity: Vec3,
    dq: T,
    ddq: T,
    body: &mut BodyState<T>,
) {
    let Transform { rotation, translation } = &body.parent_from_body;
    let translation = *translation;
    let axis = map.axis.splat::<T>();
    let (omega, alpha, acceleration) = if let Some(parent) = parent {
        let swing = parent
            .omega
            .cross_add(parent.omega.cross(translation), parent.alpha.cross_add(translation, parent.acceleration));
        (
            rotation.transpose_mul_vec(parent.omega),
            rotation.transpose_mul_vec(parent.alpha),
            rotation.transpose_mul_vec(swing),
        )
    } else {
        (Vec3::ZERO, Vec3::ZERO, rotation.transpose_mul_vec(gravity.splat()))
    };
    let own = axis.scale(dq);
    if map.turns {
        body.omega = omega + own;
        body.alpha = axis.scale_add(ddq, omega.cross_add(own, alpha));
        body.acceleration = acceleration;
    } else {
        body.omega = omega;
        body.alpha = alpha;
        let coriolis = omega.cross(own);
        body.acceleration = axis.scale_add(ddq, acceleration + coriolis + coriolis);
    }
}

/// Force and moment (about the frame origin) that move a body: `f = m a + α × h + ω × (ω × h)` and
/// `n = I α + ω × I ω + h × a` with `h = m r`, `a` the acceleration of the origin.
#[inline(always)]
pub(crate) fn inertial_wrench<T: Scalar>(
    inertial: &InertialParameters,
    omega: Vec3<T>,
    alpha: Vec3<T>,
    acceleration: Vec3<T>,
) -> (Vec3<T>, Vec3<T>) {
    let p = inertial.0.map(T::splat);
    let first_moment = Vec3([p[1], p[2], p[3]]);
    let inertia = Mat3([[p[4], p[5], p[6]], [p[5], p[7], p[8]], [p[6], p[8], p[9]]]);
    let force = omega.cross_add(omega.cross(first_moment), alpha.cross_add(first_moment, acceleration.scale(p[0])));
    let moment = omega.cross_add(inertia.mul_vec(omega), inertia.mul_vec_add(alpha, first_moment.cross(acceleration)));
    (force, moment)
}
