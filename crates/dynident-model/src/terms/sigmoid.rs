//! Friction as one sigmoid: `τ = φ₁ [1/(1 + e^{-φ₂(q̇ + φ₃)}) - 1/(1 + e^{-φ₂ φ₃})]`.
//!
//! This is Coulomb friction with a smoothed sign function of total height `φ₁`, centred at the velocity `-φ₃`. It is
//! linear in `φ₁` at given `φ₂` and `φ₃`. With `φ₃ = 0` it is half of a Coulomb friction with the width `2/φ₂`.
//! Source: Gaz, Cognetti, Oliva, Robuffo Giordano and De Luca, IEEE RA-L 4 (2019) 4147.

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint, clamped_velocity};
use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve, VelocityFriction};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedFault, StatedJoint, StudyLaw, check};
use super::{Coulomb, CoulombShape, FrictionTerm, TorqueTerm};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Sigmoid friction of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sigmoid {
    /// The joint.
    pub joint: usize,
    /// Steepness `φ₂`, s/rad or s/m, positive.
    pub steepness: f64,
    /// Offset of the velocity `φ₃`, rad/s or m/s.
    pub offset_speed: f64,
}

/// `1/(1 + e^{-x})`, without overflow.
fn logistic(x: f64) -> f64 {
    0.5 * (1.0 + (0.5 * x).tanh())
}

/// Candidate widths of the sigmoid, as widths of a smoothed sign function, rad/s or m/s of a typical arm.
const CANDIDATE_WIDTHS: [f64; 3] = [0.02, 0.05, 0.1];
/// Largest shift of the sigmoid from zero velocity, in units of its width.
const MAX_SHIFT: f64 = 2.0;

impl VelocityLaw for Sigmoid {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        let step = (dq + S::splat(self.offset_speed)).smooth_step(2.0 / self.steepness);
        let at_rest = logistic(self.steepness * self.offset_speed);
        S::splat(0.5) * (S::ONE + step) - S::splat(at_rest)
    }
}

impl Sigmoid {
    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let widths = CANDIDATE_WIDTHS.map(|width| width * own.velocity).into_iter().enumerate();
        let of = |(step, width): (usize, f64)| {
            [-0.5 * width, 0.5 * width].map(|offset_speed| {
                let term = Self { joint: own.joint, steepness: 2.0 / width, offset_speed };
                GridPoint::at(step, TorqueTerm::Sigmoid(term))
            })
        };
        widths.flat_map(of).collect()
    }
}

impl Law for Sigmoid {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw {
        constants: 2,
        is_near_rest: true,
        ..CandidateLaw::new("sigmoid", CandidateRole::Start, Self::grid)
    }];
}

/// The law `sigmoid` of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StatedSigmoid {
    /// Steepness `φ₂`, s/rad or s/m.
    pub steepness: f64,
    /// Offset of the velocity `φ₃`, rad/s or m/s.
    #[serde(default)]
    pub offset_speed: f64,
}

impl StudyLaw for StatedSigmoid {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        let &Self { steepness, offset_speed } = self;
        vec![TorqueTerm::Sigmoid(Sigmoid { joint: own.joint, steepness, offset_speed })]
    }

    fn check(&self) -> Result<(), StatedFault> {
        check("steepness", self.steepness, [1.0e-6, 1.0e9])?;
        check("offset_speed", self.offset_speed, [-1.0e6, 1.0e6])
    }
}

impl TermKind for Sigmoid {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "sigmoid", symbol: format!("sig{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction::of(VelocityCurve::Smooth(self)))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("steepness", TermConstant::Number(self.steepness, "s_per_rad")),
            ("offset_speed", TermConstant::Number(self.offset_speed, "rad_s")),
        ]
    }

    fn stated(&self) -> Option<FrictionTerm> {
        let &Self { steepness, offset_speed, .. } = self;
        Some(FrictionTerm::Sigmoid(StatedSigmoid { steepness, offset_speed }))
    }

    fn step_width_by(&self, constant: &str, value: f64) -> Option<f64> {
        (constant == "steepness").then_some(2.0 / value)
    }

    /// Without offset the sigmoid is half of a Coulomb friction.
    fn dry(&self, rest: f64) -> Option<(TorqueTerm, f64)> {
        let shape = CoulombShape::Sign { dead_band: 0.0 };
        let coulomb = TorqueTerm::Coulomb(Coulomb { joint: self.joint, shape });
        (self.offset_speed.abs() <= rest).then_some((coulomb, 0.5))
    }

    /// Second coordinate: shift of the sigmoid in units of its width.
    fn coordinates(&self) -> Vec<f64> {
        vec![self.steepness.ln(), 0.5 * self.offset_speed * self.steepness]
    }

    fn move_to(&mut self, coordinates: &[f64], velocity: f64) {
        if let [steepness, shift] = coordinates {
            self.steepness = 2.0 / clamped_velocity((2.0 / steepness.exp()).ln(), velocity);
            self.offset_speed = 2.0 * shift.clamp(-MAX_SHIFT, MAX_SHIFT) / self.steepness;
        }
    }
}
