//! Interface of the kinds of limits: values over a block of samples, and their adjoint.

use super::kind::Constraint;
use super::torque_range::TorqueRange;
use super::wrench::Wrench;
use crate::motion::{Motion, MotionAdjoint};
use core::fmt::Debug;
use dynident_model::{Transform, Vec3};

/// Inputs of a limit. Torques are joint-major like the motion. Placements (`base_from_body`) are stored sample by
/// sample; they are empty if no limit needs them.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a> {
    pub(crate) motion: &'a Motion,
    pub(crate) torque: &'a TorqueRange,
    pub(crate) placements: &'a [Transform],
    pub(crate) bodies: usize,
    /// Whether samples are consecutive times of one motion, so that obstacles are also tested between them.
    pub(crate) is_continuous: bool,
}

impl Inputs<'_> {
    /// `base_from_body` at a sample; the identity for the base.
    pub(crate) fn placement(&self, body: Option<usize>, sample: usize) -> Transform {
        body.map_or(Transform::IDENTITY, |body| self.placements[sample * self.bodies + body])
    }
}

/// Derivatives of the cost with respect to the motion, the torques, and the places of points (as forces on the bodies).
pub(crate) struct Adjoint<'a> {
    pub(crate) motion: &'a mut MotionAdjoint,
    pub(crate) torque: &'a mut TorqueRange,
    /// Forces on the bodies, sample by sample, one per body.
    pub(crate) wrenches: &'a mut [Wrench],
}

impl Adjoint<'_> {
    /// Adds the derivative of the cost with respect to the place of a point of a body (base frame).
    pub(crate) fn point(&mut self, body: Option<usize>, bodies: usize, sample: usize, place: Vec3, gradient: Vec3) {
        if let Some(body) = body {
            self.wrenches[sample * bodies + body].add(place, gradient);
        }
    }
}

pub(crate) trait Term: Debug + Send + Sync {
    fn constraints(&self) -> Vec<Constraint>;

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]);

    /// Adds the derivatives of a cost, given its derivatives `weights` with respect to the values.
    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>);

    fn needs_torque(&self) -> bool {
        false
    }

    fn needs_placements(&self) -> bool {
        false
    }
}
