//! Inertia of rotor and gear, reflected to the joint: `τ = I_a q̈`.

use super::JointMotion;

/// Reflected drive inertia of one joint, kg m² (kg).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveInertia {
    /// The joint.
    pub joint: usize,
}

impl DriveInertia {
    pub(super) fn column(self, motion: &JointMotion<'_>, out: &mut [f64]) {
        out.copy_from_slice(motion.ddq_of(self.joint));
    }
}
