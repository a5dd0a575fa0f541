//! State of each body during the algorithms, as plain data.

use dynident_lanes::{Lane, Scalar};
use dynident_model::{Mat3, Model, Transform, Vec3};

/// State of one body during an algorithm over scalars `T`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyState<T> {
    /// `parent_from_body` at the current position.
    pub(crate) parent_from_body: Transform<T>,
    /// Angular velocity, body frame.
    pub(crate) omega: Vec3<T>,
    /// Angular acceleration, body frame.
    pub(crate) alpha: Vec3<T>,
    /// Acceleration of the body frame's origin minus gravity, body frame.
    pub(crate) acceleration: Vec3<T>,
    /// Force on the body and its subtree, body frame.
    pub(crate) force: Vec3<T>,
    /// Moment on the body and its subtree about its frame's origin, body frame.
    pub(crate) moment: Vec3<T>,
}

impl<T: Scalar> BodyState<T> {
    pub(crate) const REST: Self = Self {
        parent_from_body: Transform::IDENTITY,
        omega: Vec3::ZERO,
        alpha: Vec3::ZERO,
        acceleration: Vec3::ZERO,
        force: Vec3::ZERO,
        moment: Vec3::ZERO,
    };
}

/// Motion of a body in its inner frame ([`dynident_model::JointStep`]).
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkMotion<T> {
    pub(crate) omega: Vec3<T>,
    pub(crate) alpha: Vec3<T>,
    /// Acceleration of the frame's origin minus gravity.
    pub(crate) acceleration: Vec3<T>,
    /// `[α]× + [ω]× [ω]×`.
    pub(crate) spin: Mat3<T>,
}

impl<T: Scalar> LinkMotion<T> {
    pub(crate) const REST: Self =
        Self { omega: Vec3::ZERO, alpha: Vec3::ZERO, acceleration: Vec3::ZERO, spin: Mat3::ZERO };
}

/// Wrench on a body and its subtree, in its inner frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkWrench<T> {
    pub(crate) force: Vec3<T>,
    /// Moment about the frame's origin.
    pub(crate) moment: Vec3<T>,
}

impl<T: Scalar> LinkWrench<T> {
    pub(crate) const ZERO: Self = Self { force: Vec3::ZERO, moment: Vec3::ZERO };
}

/// Articulated-body inertia of a subtree about the frame of its root body: `moment = rotation α + coupling a`, `force
/// = couplingᵀ α + mass a`. Also contains the data for the joint of that body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArticulatedInertia<T> {
    /// Symmetric 3 × 3 matrix; upper triangle by rows.
    pub(crate) rotation: [T; 6],
    pub(crate) coupling: Mat3<T>,
    /// Symmetric 3 × 3 matrix; upper triangle by rows.
    pub(crate) mass: [T; 6],
    /// Column of the articulated inertia along the joint, in the parent's frame: (moment, force). Not set at the base.
    pub(crate) column: (Vec3<T>, Vec3<T>),
    pub(crate) inverse_inertia: T,
    pub(crate) rest_torque: T,
}

impl<T: Scalar> ArticulatedInertia<T> {
    pub(crate) const ZERO: Self = Self {
        rotation: [T::ZERO; 6],
        coupling: Mat3::ZERO,
        mass: [T::ZERO; 6],
        column: (Vec3::ZERO, Vec3::ZERO),
        inverse_inertia: T::ZERO,
        rest_torque: T::ZERO,
    };
}

/// Axes of all joints on the path to each body, as twists at the body's frame, several per bundle.
#[derive(Debug)]
pub(crate) struct AxisScratch<T: Lane> {
    /// Joints from the base to each body, body after body.
    pub(crate) path: Vec<u32>,
    /// Start of each body's path in `path`, plus the end.
    pub(crate) path_start: Vec<usize>,
    /// Start of each body's bundles.
    pub(crate) bundle_start: Vec<usize>,
    pub(crate) angular: Vec<Vec3<T::Bundle>>,
    pub(crate) linear: Vec<Vec3<T::Bundle>>,
}

impl<T: Lane> AxisScratch<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let (mut path, mut path_start, mut bundle_start) = (Vec::new(), vec![0], vec![0]);
        for body in 0..model.body_count() {
            let joints = model.path(body);
            bundle_start.push(bundle_start[body] + joints.len().div_ceil(T::PER_BUNDLE));
            path.extend(joints.iter().map(|&joint| joint as u32));
            path_start.push(path.len());
        }
        let bundles = bundle_start[model.body_count()];
        Self { path, path_start, bundle_start, angular: vec![Vec3::ZERO; bundles], linear: vec![Vec3::ZERO; bundles] }
    }
}

#[derive(Debug)]
pub(crate) struct AdjointScratch<T> {
    pub(crate) path: Vec<u32>,
    pub(crate) path_start: Vec<usize>,
    /// Axes of the joints on the path to each body, as twists at the body's frame: angular, linear.
    pub(crate) axes: Vec<(Vec3<T>, Vec3<T>)>,
    pub(crate) by_axes: Vec<(Vec3<T>, Vec3<T>)>,
    pub(crate) by_motion: Vec<BodyAdjoint<T>>,
    pub(crate) joints: Vec<JointAdjoint<T>>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyAdjoint<T> {
    pub(crate) omega: Vec3<T>,
    pub(crate) alpha: Vec3<T>,
    pub(crate) acceleration: Vec3<T>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct JointAdjoint<T> {
    pub(crate) q: T,
    pub(crate) dq: T,
    pub(crate) ddq: T,
}

impl<T: Scalar> AdjointScratch<T> {
    pub(crate) fn new(model: &Model) -> Self {
        let (mut path, mut path_start) = (Vec::new(), vec![0]);
        for body in 0..model.body_count() {
            path.extend(model.path(body).iter().map(|&joint| joint as u32));
            path_start.push(path.len());
        }
        let (pairs, bodies) = (path.len(), model.body_count());
        let still = BodyAdjoint { omega: Vec3::ZERO, alpha: Vec3::ZERO, acceleration: Vec3::ZERO };
        Self {
            path,
            path_start,
            axes: vec![(Vec3::ZERO, Vec3::ZERO); pairs],
            by_axes: vec![(Vec3::ZERO, Vec3::ZERO); pairs],
            by_motion: vec![still; bodies],
            joints: vec![JointAdjoint { q: T::ZERO, dq: T::ZERO, ddq: T::ZERO }; bodies],
        }
    }
}
