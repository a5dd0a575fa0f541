//! Viscous friction: `τ = F_v q̇`.

use super::JointMotion;

/// Viscous friction of one joint, Nm s/rad (N s/m).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viscous {
    /// The joint.
    pub joint: usize,
}

impl Viscous {
    pub(super) fn column(self, motion: &JointMotion<'_>, out: &mut [f64]) {
        out.copy_from_slice(motion.dq_of(self.joint));
    }
}
