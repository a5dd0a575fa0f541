//! A constant torque: sensor bias, unmodelled spring, asymmetric friction. `τ = τ_0`.

use super::kind::{TermAction, TermJoints, TermKind, TermLabel};
use super::law::{Law, VelocityLaw};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Constant torque of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Offset {
    /// The joint.
    pub joint: usize,
}

impl VelocityLaw for Offset {
    #[inline(always)]
    fn of<S: Real>(&self, _: S) -> S {
        S::ONE
    }
}

impl Law for Offset {}

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
}
