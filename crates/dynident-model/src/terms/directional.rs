//! Friction with one parameter per direction of motion.
//!
//! Viscous: `τ = F_v⁺ max(q̇, 0) + F_v⁻ min(q̇, 0)`. Coulomb: `τ = F_c⁺ max(s(q̇), 0) + F_c⁻ min(s(q̇), 0)` with a
//! smoothed or unsmoothed sign function `s`. All four parameters are positive if friction dissipates power. With an
//! unsmoothed sign function, the two Coulomb columns and an offset are linearly dependent: use only two of the three.

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
use super::kind::{
    MotionFunction, StepRole, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve,
    VelocityFriction, halves,
};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedJoint, StudyLaw};
use super::{Coulomb, CoulombShape, FrictionTerm, TorqueTerm, Viscous};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Direction of motion.
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
    const BOTH: [Self; 2] = [Self::Forward, Self::Backward];

    /// `+` or `-`, as in the parameter's symbol.
    pub fn sign(self) -> char {
        match self {
            Self::Forward => '+',
            Self::Backward => '-',
        }
    }

    /// The part of `value` in this direction.
    #[inline(always)]
    fn part<S: Real>(self, value: S) -> S {
        match self {
            Self::Forward => value.max(S::ZERO),
            Self::Backward => value.min(S::ZERO),
        }
    }

    fn constant(self) -> TermConstant {
        TermConstant::Word(match self {
            Self::Forward => "+",
            Self::Backward => "-",
        })
    }

    /// The half of a function that acts in this direction.
    fn half(self, halves: [MotionFunction; 2]) -> Vec<MotionFunction> {
        let [forward, backward] = halves;
        match self {
            Self::Forward => vec![forward],
            Self::Backward => vec![backward],
        }
    }
}

/// Viscous friction of one joint in one direction, Nm s/rad (N s/m).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionalViscous {
    /// The joint.
    pub joint: usize,
    /// Direction of motion in which the friction acts.
    pub direction: Direction,
}

impl VelocityLaw for DirectionalViscous {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        self.direction.part(dq)
    }
}

impl DirectionalViscous {
    fn both(joint: usize) -> Vec<TorqueTerm> {
        Direction::BOTH.map(|direction| TorqueTerm::DirectionalViscous(Self { joint, direction })).to_vec()
    }
}

impl Law for DirectionalViscous {
    const CANDIDATES: &'static [CandidateLaw] =
        &[CandidateLaw::new("asymmetric viscous", CandidateRole::InPlaceOf("viscous"), |own| {
            vec![GridPoint { terms: Self::both(own.joint), step: None }]
        })];
}

/// The law `asymmetric-viscous` of a study: viscous friction with one coefficient per direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AsymmetricViscous {}

impl StudyLaw for AsymmetricViscous {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        DirectionalViscous::both(own.joint)
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

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction::of(VelocityCurve::Smooth(self)))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("direction", self.direction.constant())]
    }

    fn functions(&self) -> Vec<MotionFunction> {
        self.direction.half(halves(self.joint, "viscous"))
    }

    fn stated(&self) -> Option<FrictionTerm> {
        Some(FrictionTerm::AsymmetricViscous(AsymmetricViscous {}))
    }

    fn both_directions(&self) -> Option<[TorqueTerm; 2]> {
        let other = TorqueTerm::DirectionalViscous(Self { direction: Direction::Backward, ..*self });
        let of_both = TorqueTerm::Viscous(Viscous { joint: self.joint });
        (self.direction == Direction::Forward).then_some([other, of_both])
    }
}

/// Coulomb friction of one joint in one direction, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DirectionalCoulomb {
    /// The joint.
    pub joint: usize,
    /// Direction of motion in which the friction acts.
    pub direction: Direction,
    /// The smoothed or unsmoothed sign function.
    pub shape: CoulombShape,
}

impl VelocityLaw for DirectionalCoulomb {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        self.direction.part(self.shape.of(dq))
    }
}

impl DirectionalCoulomb {
    fn both(joint: usize, shape: CoulombShape) -> Vec<TorqueTerm> {
        Direction::BOTH.map(|direction| TorqueTerm::DirectionalCoulomb(Self { joint, direction, shape })).to_vec()
    }

    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let of = |(step, &width): (usize, &f64)| GridPoint {
            terms: Self::both(own.joint, CoulombShape::Smooth { width }),
            step: Some(step),
        };
        own.widths.iter().enumerate().map(of).collect()
    }
}

impl Law for DirectionalCoulomb {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw {
        constants: 1,
        is_step: true,
        ..CandidateLaw::new("asymmetric coulomb", CandidateRole::InPlaceOf("coulomb"), Self::grid)
    }];
}

/// The law `asymmetric-coulomb` of a study: Coulomb friction with one level per direction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AsymmetricCoulomb {}

impl StudyLaw for AsymmetricCoulomb {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        DirectionalCoulomb::both(own.joint, own.step)
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

    fn functions(&self) -> Vec<MotionFunction> {
        self.direction.half(halves(self.joint, &format!("{:?}", self.shape)))
    }

    fn stated(&self) -> Option<FrictionTerm> {
        Some(FrictionTerm::AsymmetricCoulomb(AsymmetricCoulomb {}))
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        Some(&mut self.shape)
    }

    fn step_role(&self) -> StepRole {
        StepRole::Joint
    }

    fn both_directions(&self) -> Option<[TorqueTerm; 2]> {
        let other = TorqueTerm::DirectionalCoulomb(Self { direction: Direction::Backward, ..*self });
        let of_both = TorqueTerm::Coulomb(Coulomb { joint: self.joint, shape: self.shape });
        (self.direction == Direction::Forward).then_some([other, of_both])
    }
}
