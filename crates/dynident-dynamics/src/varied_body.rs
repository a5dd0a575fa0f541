//! A body in the base frame, with the quantities for derivatives with respect to the joint motion.

use crate::ground::{MassMoments, MomentRates, Spatial};
use crate::hinge::{Hinge, PlacedHinges, with_hinge};
use dynident_lanes::Scalar;
use dynident_model::{JointStep, Transform, Vec3};

/// State of a body for the derivatives of the inverse dynamics, in the base frame. Moments, rates and wrench first
/// refer to the body alone, then to its subtree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VariedBody<T> {
    /// `base_from_body`.
    pub(crate) placement: Transform<T>,
    pub(crate) velocity: Spatial<T>,
    /// Spatial acceleration minus gravity.
    pub(crate) acceleration: Spatial<T>,
    /// The joint's axis `S` as a twist.
    pub(crate) axis: Spatial<T>,
    /// `2 Ψ̇ = 2 v × S`: twice the rate of the axis.
    pub(crate) twice_rate: Spatial<T>,
    /// `Ψ̈ = a × S + v × Ψ̇`, with velocity and acceleration of the parent.
    pub(crate) second_rate: Spatial<T>,
    pub(crate) moments: MassMoments<T>,
    pub(crate) rates: MomentRates<T>,
    pub(crate) wrench: Spatial<T>,
}

impl<T: Scalar> VariedBody<T> {
    pub(crate) const REST: Self = Self {
        placement: Transform::IDENTITY,
        velocity: Spatial::ZERO,
        acceleration: Spatial::ZERO,
        axis: Spatial::ZERO,
        twice_rate: Spatial::ZERO,
        second_rate: Spatial::ZERO,
        moments: MassMoments::ZERO,
        rates: MomentRates::ZERO,
        wrench: Spatial::ZERO,
    };

    /// Computes placement, axis and inertia from the placement of `parent` and the joint of `step`, which has index
    /// `index` in the hinges.
    #[inline(always)]
    pub(crate) fn follow(&mut self, parent: &Self, step: &JointStep, index: usize, hinges: &PlacedHinges<'_, T>) {
        let above = &parent.placement;
        self.placement.translation = above.point(hinges.translation(step, index));
        self.placement.rotation = with_hinge!(hinges, *step, index, |hinge| hinge.after(&above.rotation));
        let Transform { rotation, translation } = &self.placement;
        let direction = Vec3([rotation.0[0][2], rotation.0[1][2], rotation.0[2][2]]);
        self.axis = Spatial::axis(step.is_rotary, direction, *translation);
        self.moments = MassMoments::of(step, &self.placement);
    }

    /// Computes the velocity from the velocity of `parent` and the joint velocity `dq`, and the quantities that
    /// depend on it; returns the rate of the axis, `Ψ̇ = v × S`.
    #[inline(always)]
    pub(crate) fn move_along(&mut self, parent: &Self, dq: T) -> Spatial<T> {
        // The parent's velocity gives the same result, because S × S = 0.
        let rate = parent.velocity.cross(&self.axis);
        self.velocity = self.axis.scale_add(dq, &parent.velocity);
        self.twice_rate = Spatial { angular: rate.angular + rate.angular, linear: rate.linear + rate.linear };
        self.rates = MomentRates::of(&self.moments, &self.velocity);
        rate
    }
}
