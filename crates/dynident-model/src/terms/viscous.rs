//! Viscous friction: `τ = F_v q̇`.

use super::TorqueTerm;
use super::candidate::{CandidateLaw, CandidateRole, GridPoint};
use super::kind::{JointProperty, MotionFunction, TermAction, TermJoints, TermKind, TermLabel, halves};
use super::law::{Law, VelocityLaw};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Viscous friction of one joint, Nm s/rad (N s/m).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Viscous {
    /// The joint.
    pub joint: usize,
}

impl VelocityLaw for Viscous {
    #[inline(always)]
    fn of<S: Real>(&self, dq: S) -> S {
        dq
    }
}

impl Law for Viscous {
    const CANDIDATES: &'static [CandidateLaw] = &[CandidateLaw::new("viscous", CandidateRole::Base, |own| {
        vec![GridPoint::alone(TorqueTerm::Viscous(Self { joint: own.joint }))]
    })];
}

impl TermKind for Viscous {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "viscous", symbol: format!("fv{}", self.joint + 1), unit: "Nm s/rad" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Damping { factor: 1.0 }
    }

    fn functions(&self) -> Vec<MotionFunction> {
        halves(self.joint, "viscous").into()
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::Damping)
    }
}
