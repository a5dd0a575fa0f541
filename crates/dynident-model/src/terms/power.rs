//! Friction by a power of velocity, rounded near rest: `τ = F q̇ (q̇² + ε²)^{(p-1)/2}`, which is `F |q̇|^p sign(q̇)`
//! for velocities well above `ε`.
//!
//! The power `p = 1/3` describes sub-linear losses of harmonic drives, `p = 2` churning of lubricant. The rounding
//! keeps the slope of the cube root finite at rest.

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve, VelocityFriction};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedJoint, StudyLaw};
use super::{FrictionTerm, TorqueTerm};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Friction of one joint by a power of its velocity, Nm (s/rad)^p.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Power {
    /// The joint.
    pub joint: usize,
    /// The power.
    pub exponent: PowerExponent,
    /// Velocity `ε` below which the function is rounded, rad/s or m/s, positive.
    pub rounding: f64,
}

impl Power {
    /// Default of the rounding velocity, rad/s or m/s of a typical arm
    /// ([`CharacteristicScale::velocity`](crate::CharacteristicScale::velocity)): a differentiated encoder signal
    /// cannot distinguish it from rest.
    pub const ROUNDING: f64 = 1.0e-3;

    fn usual(own: &StatedJoint, exponent: PowerExponent) -> Vec<TorqueTerm> {
        let rounding = own.scale.velocity(own.is_rotary, Self::ROUNDING);
        vec![TorqueTerm::Power(Self { joint: own.joint, exponent, rounding })]
    }

    fn grid(own: &CandidateJoint, exponent: PowerExponent) -> Vec<GridPoint> {
        let rounding = Self::ROUNDING * own.velocity;
        vec![GridPoint::alone(TorqueTerm::Power(Self { joint: own.joint, exponent, rounding }))]
    }
}

/// Supported powers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PowerExponent {
    /// `p = 1/3`.
    CubeRoot,
    /// `p = 2`.
    Quadratic,
}

impl PowerExponent {
    fn value(self) -> f64 {
        match self {
            Self::CubeRoot => 1.0 / 3.0,
            Self::Quadratic => 2.0,
        }
    }
}

impl VelocityLaw for Power {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        let square = dq * dq + S::splat(self.rounding * self.rounding);
        match self.exponent {
            PowerExponent::CubeRoot => dq.over(square.power(1.0 / 3.0)),
            PowerExponent::Quadratic => dq * square.power(0.5),
        }
    }
}

impl Law for Power {
    const CANDIDATES: &'static [CandidateLaw] = &[
        CandidateLaw {
            is_near_rest: true,
            ..CandidateLaw::new("cube-root", CandidateRole::Addition, |own| Self::grid(own, PowerExponent::CubeRoot))
        },
        CandidateLaw::new("quadratic", CandidateRole::Addition, |own| Self::grid(own, PowerExponent::Quadratic)),
    ];

    fn candidate(&self) -> Option<&'static CandidateLaw> {
        let [cube_root, quadratic] = Self::CANDIDATES else { return None };
        Some(match self.exponent {
            PowerExponent::CubeRoot => cube_root,
            PowerExponent::Quadratic => quadratic,
        })
    }
}

/// The law `cube-root` of a study: friction by the cube root of the velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CubeRoot {}

impl StudyLaw for CubeRoot {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        Power::usual(own, PowerExponent::CubeRoot)
    }
}

/// The law `quadratic` of a study: friction by the square of the velocity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Quadratic {}

impl StudyLaw for Quadratic {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        Power::usual(own, PowerExponent::Quadratic)
    }
}

impl TermKind for Power {
    fn label(&self) -> TermLabel<'_> {
        let (letters, unit) = match self.exponent {
            PowerExponent::CubeRoot => ("fr", "Nm (s/rad)^(1/3)"),
            PowerExponent::Quadratic => ("fq", "Nm (s/rad)^2"),
        };
        TermLabel { kind: "power", symbol: format!("{letters}{}", self.joint + 1), unit }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction::of(VelocityCurve::Smooth(self)))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("exponent", TermConstant::Number(self.exponent.value(), "")),
            ("rounding", TermConstant::Number(self.rounding, "rad_s")),
        ]
    }

    fn stated(&self) -> Option<FrictionTerm> {
        Some(match self.exponent {
            PowerExponent::CubeRoot => FrictionTerm::CubeRoot(CubeRoot {}),
            PowerExponent::Quadratic => FrictionTerm::Quadratic(Quadratic {}),
        })
    }
}
