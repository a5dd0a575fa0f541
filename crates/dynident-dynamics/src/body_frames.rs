//! Recursions in the bodies' own frames over any scalar, for the torque regressor (whose columns belong to these
//! frames) and for generated programs. [`crate::inverse_dynamics()`] and [`crate::mass_matrix()`] use the faster
//! recursions over the model's inner frames.

use crate::composite::Composite;
use crate::states::BodyState;
use crate::workspace::CoreScratch;
use dynident_lanes::Scalar;
use dynident_model::{InertialParameters, JointMap, Mat3, Model, Transform, Vec3};

/// Recursive Newton-Euler: computes `tau` of the scratch from its `q`, `dq`, `ddq`.
#[inline(always)]
pub(crate) fn newton_euler<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let maps = model.maps();
    scratch.place(maps);
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
        scratch.tau[index] = map.axis.splat().dot(if map.is_rotary { body.moment } else { body.force });
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

/// One step outward: motion of a body from the motion of its parent and the transform in `body`. `gravity` is the
/// acceleration of the base minus gravity.
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
    if map.is_rotary {
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

/// Force and moment (about the frame origin) that move a body: `f = m a + α × h + ω × (ω × h)` and `n = I α + ω × I ω
/// + h × a` with `h = m r`, `a` the acceleration of the origin.
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

/// Composite rigid bodies: computes the matrix of the scratch from its `q`.
#[inline(always)]
pub(crate) fn composite_rigid_bodies<T: Scalar>(model: &Model, scratch: &mut CoreScratch<T>) {
    let (maps, dof) = (model.maps(), model.body_count());
    scratch.place(maps);
    for (composite, inertial) in scratch.composites.iter_mut().zip(model.inertials()) {
        *composite = Composite::of(inertial);
    }
    let matrix = &mut scratch.matrix;
    // Joints on different branches do not couple; entries along a path are written below.
    matrix.fill(T::ZERO);
    for index in (0..dof).rev() {
        let map = &maps[index];
        let axis = map.axis.splat::<T>();
        let (inner, outer) = scratch.composites.split_at_mut(index);
        let composite = &outer[0];
        // Force and moment that accelerate the composite along or about its joint's axis.
        let (mut force, mut moment) = if map.is_rotary {
            (axis.cross(composite.first_moment), composite.inertia_matrix().mul_vec(axis))
        } else {
            (axis.scale(composite.mass), composite.first_moment.cross(axis))
        };
        matrix[index * dof + index] = axis.dot(if map.is_rotary { moment } else { force });
        let (mut at, mut link) = (index, map.parent);
        while let Some(parent) = link {
            let frame = &scratch.bodies[at].parent_from_body;
            let map = &maps[parent];
            force = frame.rotation.mul_vec(force);
            moment = frame.translation.cross_add(force, frame.rotation.mul_vec(moment));
            let along: Vec3<T> = map.axis.splat();
            let entry = along.dot(if map.is_rotary { moment } else { force });
            matrix[index * dof + parent] = entry;
            matrix[parent * dof + index] = entry;
            (at, link) = (parent, map.parent);
        }
        if let Some(parent) = map.parent {
            inner[parent].add(composite, &scratch.bodies[index].parent_from_body);
        }
    }
}
