//! One element of the generalised Maxwell-slip model: a spring in series with a Coulomb slider, `τ = W z/Δ`.
//!
//! The spring's deflection follows the joint and stops at the yield displacement: `z ← clamp(z + q_k - q_{k-1}, -Δ,
//! Δ)`. Elements with a grid of `Δ` side by side give friction with hysteresis after reversals, linear in their yield
//! torques `W`. The deflection is the one thing that a term remembers from sample to sample ([`HysteresisState`]); an
//! uninterrupted recording starts undeflected, and the start is forgotten once the joint has moved by 2Δ in one
//! direction. Source: Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control 50 (2005) 1883 (without its
//! sliding dynamics); Lampaert, Swevers and Al-Bender (2002).

use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::{JointMotion, TermInput};
use serde::{Deserialize, Serialize};

/// Yield torque of one element of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MaxwellSlip {
    /// The joint.
    pub joint: usize,
    /// Yield displacement `Δ`, rad or m, positive; part of the parameter's symbol.
    pub yield_displacement: f64,
}

/// What a term remembers of the samples before a block; [`Default`] is the start of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HysteresisState {
    /// Last position and deflection.
    last: Option<[f64; 2]>,
}

impl HysteresisState {
    /// Forgets: the next sample starts a recording.
    pub fn restart(&mut self) {
        self.last = None;
    }
}

impl TermKind for MaxwellSlip {
    fn label(&self) -> TermLabel<'_> {
        TermLabel {
            kind: "maxwell-slip",
            symbol: format!("slip{}_{}", self.joint + 1, self.yield_displacement),
            unit: "Nm",
        }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Hysteresis
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("yield_displacement", TermConstant::Number(self.yield_displacement))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        let (limit, memory) = (self.yield_displacement, &mut *input.memory);
        for (to, &q) in out.iter_mut().zip(motion.q_of(self.joint)) {
            let [before, deflection] = memory.last.unwrap_or([q, 0.0]);
            let deflection = (deflection + q - before).clamp(-limit, limit);
            memory.last = Some([q, deflection]);
            *to = deflection / limit;
        }
    }

    fn apply_adjoint(&self, _: usize, _: &JointMotion<'_>, _: &[f64], _: [&mut [f64]; 3]) {
        // The deflection follows positions.
    }
}
