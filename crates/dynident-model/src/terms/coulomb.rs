//! Coulomb friction: `τ = F_c s(q̇)`, where `s` is the sign function or a smoothed sign function.

use super::TorqueTerm;
use super::candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
use super::kind::{
    JointProperty, MotionFunction, StepRole, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve,
    VelocityFriction, VelocityFunction, halves,
};
use super::law::{Law, VelocityLaw};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// The function `s` of Coulomb friction: how the friction changes its sign near zero velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CoulombShape {
    /// Sign function: `sign(q̇)`, and zero while `|q̇|` is at most `dead_band` (rad/s or m/s; can be zero).
    Sign {
        /// Half width of the band without friction torque.
        dead_band: f64,
    },
    /// Smoothed sign function: `tanh(q̇ / width)`, which avoids chatter due to velocity noise near rest.
    Smooth {
        /// Velocity at which the function has reached 76 % of its final value, rad/s or m/s, positive.
        width: f64,
    },
}

impl CoulombShape {
    /// Default width of a smoothed sign function, rad/s or m/s of a typical arm
    /// ([`CharacteristicScale::velocity`](crate::CharacteristicScale::velocity)).
    pub const USUAL_WIDTH: f64 = 0.02;

    /// Value of the function at velocity `dq`.
    #[inline]
    pub fn step(self, dq: f64) -> f64 {
        self.of(dq)
    }

    /// Derivative with respect to velocity; zero for the unsmoothed sign function.
    #[inline]
    pub fn slope(self, dq: f64) -> f64 {
        VelocityFunction::slope(&self, dq)
    }

    /// Friction curve of a robot. It has no dead band: dead bands only handle noisy velocities in a log.
    pub(super) fn curve(&self) -> VelocityCurve<'_> {
        match self {
            Self::Sign { .. } => VelocityCurve::Step { forward: true, backward: true },
            Self::Smooth { .. } => VelocityCurve::Smooth(self),
        }
    }
}

impl VelocityLaw for CoulombShape {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        match *self {
            Self::Sign { dead_band } => dq.sign(dead_band),
            Self::Smooth { width } => dq.smooth_step(width),
        }
    }
}

/// Coulomb friction of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Coulomb {
    /// The joint.
    pub joint: usize,
    /// The smoothed or unsmoothed sign function.
    pub shape: CoulombShape,
}

impl VelocityLaw for Coulomb {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        self.shape.of(dq)
    }
}

impl Coulomb {
    /// Candidate widths of the smoothed sign function, rad/s or m/s of a typical arm. The unsmoothed sign function
    /// and a width given in the study are also candidates.
    pub const WIDTHS: [f64; 7] = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2];

    fn grid(own: &CandidateJoint) -> Vec<GridPoint> {
        let of = |shape| TorqueTerm::Coulomb(Self { joint: own.joint, shape });
        let alone = own.alone.iter().map(|shape| GridPoint::alone(of(*shape)));
        let smooth = own.widths.iter().enumerate();
        alone.chain(smooth.map(|(step, &width)| GridPoint::at(step, of(CoulombShape::Smooth { width })))).collect()
    }
}

impl Law for Coulomb {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw {
        constants: 1,
        is_step: true,
        ..CandidateLaw::new("coulomb", CandidateRole::Start, Self::grid)
    }];
}

impl TermKind for Coulomb {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "coulomb", symbol: format!("fc{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction::of(self.shape.curve()))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("shape", TermConstant::Step(self.shape))]
    }

    fn functions(&self) -> Vec<MotionFunction> {
        halves(self.joint, &format!("{:?}", self.shape)).into()
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::Friction)
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        Some(&mut self.shape)
    }

    fn step_role(&self) -> StepRole {
        StepRole::Joint
    }
}
