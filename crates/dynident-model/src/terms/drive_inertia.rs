//! Inertia of rotor and gear, reflected to the joint: `τ = I_a q̈`.

use super::kind::{JointProperty, TermAction, TermJoints, TermKind, TermLabel};
use super::law::{Law, VelocityLaw};
use super::{JointMotion, TermInput};
use serde::{Deserialize, Serialize};

/// Reflected drive inertia of one joint, kg m² (kg).
#[doc(alias("rotor inertia", "armature"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DriveInertia {
    /// The joint.
    pub joint: usize,
}

impl VelocityLaw for DriveInertia {}

impl Law for DriveInertia {}

impl TermKind for DriveInertia {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "drive-inertia", symbol: format!("Ia{}", self.joint + 1), unit: "kg m^2" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::DriveInertia)
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Inertia { factor: 1.0 }
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        out.copy_from_slice(motion.ddq_of(self.joint));
    }

    fn apply_adjoint(&self, _: usize, motion: &JointMotion<'_>, weights: &[f64], adjoints: [&mut [f64]; 3]) {
        let [_, _, by_ddq] = adjoints;
        let range = self.joint * motion.samples..(self.joint + 1) * motion.samples;
        by_ddq[range].iter_mut().zip(weights).for_each(|(to, w)| *to += w);
    }
}
