//! A body in the base's frame with all that derivatives by the joints' motion ask of it.

use crate::ground::{MassMoments, MomentRates, Spatial};
use crate::hinge::{Hinge, PlacedHinges, with_hinge};
use dynident_lanes::Scalar;
use dynident_model::{JointStep, Transform, Vec3};

/// What the derivatives of the inverse dynamics need of a body, all in the base's frame. Inertia and wrench are the
/// body's own at first, then those of everything that moves with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VariedBody<T> {
    /// `base_from_body`.
    pub(crate) placement: Transform<T>,
    pub(crate) velocity: Spatial<T>,
    /// Minus gravity.
    pub(crate) acceleration: Spatial<T>,
    /// The joint's axis `S` as a twist.
    pub(crate) axis: Spatial<T>,
    /// `2 Ψ̇ = 2 v × S`: how the axis moves.
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

    /// Takes a place behind `parent` by the joint of `step`, at number `index` of the hinges, and its axis and own
    /// inertia there.
    #[inline(always)]
    pub(crate) fn follow(&mut self, parent: &Self, step: &JointStep, index: usize, hinges: &PlacedHinges<'_, T>) {
        let above = &parent.placement;
        self.placement.translation = above.point(hinges.translation(step, index));
        self.placement.rotation = with_hinge!(hinges, *step, index, |hinge| hinge.after(&above.rotation));
        let Transform { rotation, translation } = &self.placement;
        let direction = Vec3([rotation.0[0][2], rotation.0[1][2], rotation.0[2][2]]);
        self.axis = Spatial::axis(step.turns, direction, *translation);
        self.moments = MassMoments::of(step, &self.placement);
    }

    /// Takes its velocity behind `parent`, its joint moving at `dq`, and what changes with it; returns how the axis
    /// moves, `Ψ̇ = v × S`.
    #[inline(always)]
    pub(crate) fn move_along(&mut self, parent: &Self, dq: T) -> Spatial<T> {
        // The parent's velocity and the body's own move the axis alike: S × S = 0.
        let rate = parent.velocity.cross(&self.axis);
        self.velocity = self.axis.scale_add(dq, &parent.velocity);
        self.twice_rate = Spatial { angular: rate.angular + rate.angular, linear: rate.linear + rate.linear };
        self.rates = MomentRates::of(&self.moments, &self.velocity);
        rate
    }
}
