//! Friction that differs by direction: one parameter for motion forward, one for motion backward.
//!
//! Viscous: `τ = F_v⁺ max(q̇, 0) + F_v⁻ min(q̇, 0)`. Coulomb: `τ = F_c⁺ max(s(q̇), 0) + F_c⁻ min(s(q̇), 0)` with a step
//! `s`. All four parameters are positive where friction takes power. With a step that is a sign, the two Coulomb
//! columns and an offset say the same: keep two of the three.

use super::kind::{
    MotionFunction, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve, VelocityFriction,
    VelocityFunction, column_of_velocity, halves, smooth_friction,
};
use super::{CoulombShape, JointMotion};
use serde::{Deserialize, Serialize};

/// Sense of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Positive velocity.
    Forward,
    /// Negative velocity.
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

    fn constant(self) -> TermConstant {
        TermConstant::Word(match self {
            Self::Forward => "+",
            Self::Backward => "-",
        })
    }

    /// Its half of a function.
    fn half(self, halves: [MotionFunction; 2]) -> Vec<MotionFunction> {
        let [forward, backward] = halves;
        match self {
            Self::Forward => vec![forward],
            Self::Backward => vec![backward],
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionalViscous {
    /// The joint.
    pub joint: usize,
    /// The direction in which it is felt.
    pub direction: Direction,
}

impl VelocityFunction for DirectionalViscous {
    fn value(&self, dq: f64) -> f64 {
        self.direction.part(dq)
    }

    fn slope(&self, dq: f64) -> f64 {
        f64::from(self.direction.holds(dq))
    }
}

impl TermKind for DirectionalViscous {
    fn label(&self) -> TermLabel<'_> {
        TermLabel {
            kind: "directional-viscous",
            symbol: format!("fv{}{}", self.joint + 1, self.direction.sign()),
            unit: "Nm s/rad",
        }
    }

    smooth_friction!();

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("direction", self.direction.constant())]
    }

    column_of_velocity!();

    fn functions(&self) -> Vec<MotionFunction> {
        self.direction.half(halves(self.joint, "viscous"))
    }
}

/// Coulomb friction of one joint in one direction, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionalCoulomb {
    /// The joint.
    pub joint: usize,
    /// The direction in which it is felt.
    pub direction: Direction,
    /// The step near zero velocity.
    pub shape: CoulombShape,
}

impl VelocityFunction for DirectionalCoulomb {
    fn value(&self, dq: f64) -> f64 {
        self.direction.part(self.shape.step(dq))
    }

    fn slope(&self, dq: f64) -> f64 {
        if self.direction.holds(dq) { self.shape.slope(dq) } else { 0.0 }
    }

    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        self.shape.steps(motion.dq_of(joint), out);
        for step in out.iter_mut() {
            *step = self.direction.part(*step);
        }
    }
}

impl TermKind for DirectionalCoulomb {
    fn label(&self) -> TermLabel<'_> {
        TermLabel {
            kind: "directional-coulomb",
            symbol: format!("fc{}{}", self.joint + 1, self.direction.sign()),
            unit: "Nm",
        }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        let forward = self.direction == Direction::Forward;
        let curve = match self.shape {
            CoulombShape::Sign { .. } => VelocityCurve::Step { forward, backward: !forward },
            CoulombShape::Smooth { .. } => VelocityCurve::Smooth(self),
        };
        TermAction::Friction(VelocityFriction::of(curve))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("direction", self.direction.constant()), ("shape", TermConstant::Step(self.shape))]
    }

    column_of_velocity!();

    fn functions(&self) -> Vec<MotionFunction> {
        self.direction.half(halves(self.joint, &format!("{:?}", self.shape)))
    }
}
