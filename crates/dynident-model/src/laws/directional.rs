//! Friction that differs by direction: one parameter for motion forward, one for motion backward.
//!
//! Viscous: `τ = F_v⁺ max(q̇, 0) + F_v⁻ min(q̇, 0)`. Coulomb: `τ = F_c⁺ max(s(q̇), 0) + F_c⁻ min(s(q̇), 0)` with a step `s`. All four parameters are
//! positive where friction takes power. With a step that is a sign, the two Coulomb columns and an offset say the same: keep two of the three.

use super::{CoulombShape, JointMotion};

/// Sense of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Positive speed.
    Forward,
    /// Negative speed.
    Backward,
}

impl Direction {
    /// `+` or `-`, as in the parameter's symbol.
    pub fn sign(self) -> char {
        match self {
            Self::Forward => '+',
            Self::Backward => '-',
        }
    }

    /// The part of `value` in this direction.
    #[inline]
    fn part(self, value: f64) -> f64 {
        match self {
            Self::Forward => value.max(0.0),
            Self::Backward => value.min(0.0),
        }
    }

    #[inline]
    fn holds(self, dq: f64) -> bool {
        match self {
            Self::Forward => dq > 0.0,
            Self::Backward => dq < 0.0,
        }
    }
}

/// Viscous friction of one joint in one direction, Nm s/rad (N s/m).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectionalViscous {
    /// The joint.
    pub joint: usize,
    /// The direction in which it is felt.
    pub direction: Direction,
}

impl DirectionalViscous {
    pub(super) fn value(self, dq: f64) -> f64 {
        self.direction.part(dq)
    }

    pub(super) fn slope(self, dq: f64) -> f64 {
        f64::from(self.direction.holds(dq))
    }
}

/// Coulomb friction of one joint in one direction, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalCoulomb {
    /// The joint.
    pub joint: usize,
    /// The direction in which it is felt.
    pub direction: Direction,
    /// The step near zero speed.
    pub shape: CoulombShape,
}

impl DirectionalCoulomb {
    pub(super) fn value(self, dq: f64) -> f64 {
        self.direction.part(self.shape.step(dq))
    }

    pub(super) fn slope(self, dq: f64) -> f64 {
        if self.direction.holds(dq) { self.shape.slope(dq) } else { 0.0 }
    }
}

/// The columns of a motion are those of its speed.
pub(super) fn by_speed(joint: usize, motion: &JointMotion<'_>, out: &mut [f64], value: impl Fn(f64) -> f64) {
    for (to, &dq) in out.iter_mut().zip(motion.dq_of(joint)) {
        *to = value(dq);
    }
}
