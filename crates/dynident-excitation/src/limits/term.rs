//! What each kind of limit offers to the set: values over a block of samples, and the way back.

use super::kind::Constraint;
use super::torque_range::TorqueRange;
use super::wrench::Wrench;
use crate::motion::{Motion, MotionAdjoint};
use core::fmt::Debug;
use dynident_model::{Transform, Vec3};

/// What a limit may look at. Torques are joint-major as the motion; placements (`base_from_body`) stand sample by
/// sample, and are empty where no limit asked for them.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a> {
    pub(crate) motion: &'a Motion,
    pub(crate) torque: &'a TorqueRange,
    pub(crate) placements: &'a [Transform],
    /// Placements of one sample.
    pub(crate) bodies: usize,
    /// Samples are consecutive times of one motion: obstacles are also looked for between them.
    pub(crate) swept: bool,
}

impl Inputs<'_> {
    /// `base_from_body` at a sample; the identity for the base.
    pub(crate) fn placement(&self, body: Option<usize>, sample: usize) -> Transform {
        body.map_or(Transform::IDENTITY, |body| self.placements[sample * self.bodies + body])
    }
}

/// Where derivatives of the cost go: by the motion, by the torques, and by the places of points as forces on the
/// bodies.
pub(crate) struct Pull<'a> {
    pub(crate) motion: &'a mut MotionAdjoint,
    pub(crate) torque: &'a mut TorqueRange,
    /// Sample by sample, one per body.
    pub(crate) wrenches: &'a mut [Wrench],
}

impl Pull<'_> {
    /// Adds the derivative of the cost by the place of a point of a body (base frame).
    pub(crate) fn point(&mut self, body: Option<usize>, bodies: usize, sample: usize, place: Vec3, gradient: Vec3) {
        if let Some(body) = body {
            self.wrenches[sample * bodies + body].add(place, gradient);
        }
    }
}

/// Constraints of one kind.
pub(crate) trait Term: Debug + Send + Sync {
    /// The rows, in the order of the values.
    fn constraints(&self) -> Vec<Constraint>;

    /// Writes `rows × samples` values.
    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]);

    /// Adds what a cost with derivatives `weights` by the values pulls.
    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], pull: &mut Pull<'_>);

    /// True if the values need torques.
    fn needs_torque(&self) -> bool {
        false
    }

    /// True if the values need placements.
    fn needs_placements(&self) -> bool {
        false
    }
}
