//! Viscous friction: `τ = F_v q̇`.

use super::kind::{
    JointProperty, MotionFunction, TermAction, TermConstant, TermJoints, TermKind, VelocityFunction, halves,
};
use super::{JointMotion, TermInput};
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
    fn name(&self) -> &'static str {
        "viscous"
    }

    fn symbol(&self) -> String {
        format!("fv{}", self.joint + 1)
    }

    fn unit(&self) -> &'static str {
        "Nm s/rad"
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

    fn column(&self, _: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        self.fill(self.joint, motion, out);
    }

    fn apply_adjoint(&self, _: usize, motion: &JointMotion<'_>, weights: &[f64], by_dq: &mut [f64], _: &mut [f64]) {
        self.add_slopes(self.joint, motion, weights, by_dq);
    }

    fn functions(&self) -> Vec<MotionFunction> {
        halves(self.joint, "viscous").into()
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::Damping)
    }
}
