//! Friction that grows with the load: `τ = k |τ_load| s(q̇)` with a step `s`.
//!
//! `τ_load` is what the gear carries: the torque of the rigid bodies, by an earlier estimate. A law knows motions only, so the load comes with them (see
//! [`LawInput`](super::LawInput)); without one the column is zero. Source: Hamon, Gautier and Garrec, IROS 2010, 6187.

use super::{CoulombShape, JointMotion};

/// Share of the load that one joint loses to friction; no unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadFriction {
    /// The joint.
    pub joint: usize,
    /// The step near zero speed.
    pub shape: CoulombShape,
}

impl LoadFriction {
    pub(super) fn column(self, motion: &JointMotion<'_>, load: Option<&[f64]>, out: &mut [f64]) {
        let Some(load) = load else { return out.fill(0.0) };
        for ((to, &dq), load) in out.iter_mut().zip(motion.dq_of(self.joint)).zip(load) {
            *to = load.abs() * self.shape.step(dq);
        }
    }
}
