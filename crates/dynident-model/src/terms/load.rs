//! Friction that grows with the load: `τ = k |τ_load| s(q̇)` with a step `s`.
//!
//! `τ_load` is what the gear carries: the torque of the rigid bodies, by an earlier estimate. A term knows motions
//! only, so the load comes with them (see [`TermInput`](super::TermInput)); without one the column is zero. Source:
//! Hamon, Gautier and Garrec, IROS 2010, 6187.

use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFriction};
use super::{CoulombShape, JointMotion, TermInput};
use serde::{Deserialize, Serialize};

/// Share of the load that one joint loses to friction; no unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LoadFriction {
    /// The joint.
    pub joint: usize,
    /// The step near zero velocity.
    pub shape: CoulombShape,
}

impl TermKind for LoadFriction {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "load", symbol: format!("fl{}", self.joint + 1), unit: "1" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction { by_load: true, ..VelocityFriction::of(self.shape.curve()) })
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("shape", TermConstant::Step(self.shape))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        let Some(load) = input.load else { return out.fill(0.0) };
        assert_eq!(load.len(), motion.samples, "one load per sample");
        for ((to, &dq), load) in out.iter_mut().zip(motion.dq_of(self.joint)).zip(load) {
            *to = load.abs() * self.shape.step(dq);
        }
    }

    fn apply_adjoint(&self, _: usize, _: &JointMotion<'_>, _: &[f64], _: [&mut [f64]; 3]) {
        // Without a load the column is zero.
    }
}
