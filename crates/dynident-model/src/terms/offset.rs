//! A constant torque: sensor bias, unmodelled spring, asymmetric friction. `τ = τ_0`.

use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::{JointMotion, TermInput};
use serde::{Deserialize, Serialize};

/// Constant torque of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Offset {
    /// The joint.
    pub joint: usize,
}

impl TermKind for Offset {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "offset", symbol: format!("off{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        false
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Constant
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        Vec::new()
    }

    fn column(&self, _: usize, _: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        out.fill(1.0);
    }

    fn apply_adjoint(&self, _: usize, _: &JointMotion<'_>, _: &[f64], _: [&mut [f64]; 3]) {
        // It does not change.
    }
}
