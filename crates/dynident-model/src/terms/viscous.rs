//! Viscous friction: `τ = F_v q̇`.

use super::kind::{
    JointProperty, MotionFunction, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFunction,
    column_of_velocity, halves,
};
use serde::{Deserialize, Serialize};

/// Viscous friction of one joint, Nm s/rad (N s/m).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Viscous {
    /// The joint.
    pub joint: usize,
}

impl VelocityFunction for Viscous {
    fn value(&self, dq: f64) -> f64 {
        dq
    }

    fn slope(&self, _: f64) -> f64 {
        1.0
    }
}

impl TermKind for Viscous {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "viscous", symbol: format!("fv{}", self.joint + 1), unit: "Nm s/rad" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Damping { factor: 1.0 }
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        Vec::new()
    }

    column_of_velocity!();

    fn functions(&self) -> Vec<MotionFunction> {
        halves(self.joint, "viscous").into()
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::Damping)
    }
}
