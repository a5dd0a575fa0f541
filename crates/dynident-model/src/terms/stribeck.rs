//! Stribeck effect, more friction near rest than in fast motion: `τ = F_s e^{-|q̇/v_s|^δ} s(q̇)` with a smoothed or
//! unsmoothed sign function `s`.
//!
//! `F_s` is the excess of static friction over Coulomb friction `F_c`. The law is linear in `F_s` at given `v_s` and
//! `δ`. Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083.

use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint, clamped_exp, clamped_velocity};
use super::kind::{StepRole, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFriction};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedFault, StatedJoint, StudyLaw, VALID_VELOCITIES, check, step_or, width_of};
use super::{CoulombShape, FrictionTerm, TorqueTerm};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Additional friction of one joint near zero velocity, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Stribeck {
    /// The joint.
    pub joint: usize,
    /// Stribeck velocity `v_s`, at which the torque has decreased to 1/e, rad/s or m/s, positive.
    pub speed: f64,
    /// Exponent `δ`, positive; usually 1 to 2.8.
    pub exponent: f64,
    /// The smoothed or unsmoothed sign function.
    pub shape: CoulombShape,
}

/// Candidate Stribeck velocities, rad/s or m/s of a typical arm, and candidate exponents.
const CANDIDATE_SPEEDS: [f64; 6] = [0.01, 0.02, 0.05, 0.1, 0.2, 0.4];
const CANDIDATE_EXPONENTS: [f64; 2] = [1.0, 2.0];
/// Bounds of the exponent.
const EXPONENT_BOUNDS: [f64; 2] = [0.5, 3.0];
/// Width of a smoothed sign function relative to the Stribeck velocity during the friction selection: the function
/// saturates at half of that velocity.
const STEP_WIDTH_RATIO: f64 = 0.25;

impl VelocityLaw for Stribeck {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        let ratio = dq.over(S::splat(self.speed)).abs();
        ratio.power(self.exponent).decay() * self.shape.of(dq)
    }
}

impl Stribeck {
    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let speeds = CANDIDATE_SPEEDS.map(|speed| speed * own.velocity).into_iter().enumerate();
        let of = |(step, speed): (usize, f64)| {
            CANDIDATE_EXPONENTS.map(|exponent| {
                let shape = CoulombShape::Smooth { width: STEP_WIDTH_RATIO * speed };
                GridPoint::at(step, TorqueTerm::Stribeck(Self { joint: own.joint, speed, exponent, shape }))
            })
        };
        speeds.flat_map(of).collect()
    }
}

impl Law for Stribeck {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw {
        constants: 2,
        is_near_rest: true,
        ..CandidateLaw::new("stribeck", CandidateRole::Addition, Self::grid)
    }];
}

/// The law `stribeck` of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StatedStribeck {
    /// Stribeck velocity `v_s`, rad/s or m/s.
    pub speed: f64,
    /// Exponent `δ`; usually 1 to 2.8.
    pub exponent: f64,
    /// Width of the smoothed sign function, rad/s or m/s; by default the sign function of the joint's Coulomb
    /// friction is used.
    #[serde(default)]
    pub width: Option<f64>,
}

impl StudyLaw for StatedStribeck {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        let (speed, exponent, shape) = (self.speed, self.exponent, step_or(self.width, own));
        vec![TorqueTerm::Stribeck(Stribeck { joint: own.joint, speed, exponent, shape })]
    }

    fn check(&self) -> Result<(), StatedFault> {
        check("speed", self.speed, VALID_VELOCITIES)?;
        check("exponent", self.exponent, [0.1, 10.0])?;
        self.width.map_or(Ok(()), |width| check("width", width, VALID_VELOCITIES))
    }
}

impl TermKind for Stribeck {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "stribeck", symbol: format!("fs{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction {
            fading: Some([self.speed, self.exponent]),
            ..VelocityFriction::of(self.shape.curve())
        })
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("speed", TermConstant::Number(self.speed, "rad_s")),
            ("exponent", TermConstant::Number(self.exponent, "")),
            ("shape", TermConstant::Step(self.shape)),
        ]
    }

    fn stated(&self) -> Option<FrictionTerm> {
        let &Self { speed, exponent, shape, .. } = self;
        Some(FrictionTerm::Stribeck(StatedStribeck { speed, exponent, width: width_of(shape) }))
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        Some(&mut self.shape)
    }

    fn step_role(&self) -> StepRole {
        StepRole::Own { width: STEP_WIDTH_RATIO * self.speed }
    }

    fn coordinates(&self) -> Vec<f64> {
        vec![self.speed.ln(), self.exponent.ln()]
    }

    fn move_to(&mut self, coordinates: &[f64], velocity: f64) {
        if let [speed, exponent] = coordinates {
            self.speed = clamped_velocity(*speed, velocity);
            self.exponent = clamped_exp(*exponent, EXPONENT_BOUNDS);
            if let CoulombShape::Smooth { width } = &mut self.shape {
                *width = STEP_WIDTH_RATIO * self.speed;
            }
        }
    }
}
