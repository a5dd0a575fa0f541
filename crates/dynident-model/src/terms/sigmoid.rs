//! Friction as one sigmoid: `τ = φ₁ [1/(1 + e^{-φ₂(q̇ + φ₃)}) - 1/(1 + e^{-φ₂ φ₃})]`.
//!
//! It is a Coulomb step of height `φ₁` whose middle lies at `-φ₃`; linear in `φ₁` at given `φ₂` and `φ₃`. With `φ₃ = 0`
//! it is half a smooth Coulomb step of width `2/φ₂`. Source: Gaz, Cognetti, Oliva, Robuffo Giordano and De Luca, IEEE
//! RA-L 4 (2019) 4147.

use super::JointMotion;
use super::kind::{
    PART, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve, VelocityFriction, VelocityFunction,
    column_of_velocity, smooth_friction,
};
use dynident_lanes::tanh_all;
use serde::{Deserialize, Serialize};

/// The step of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sigmoid {
    /// The joint.
    pub joint: usize,
    /// Steepness `φ₂`, s/rad or s/m, positive.
    pub steepness: f64,
    /// Offset of the velocity `φ₃`, rad/s or m/s.
    pub offset_speed: f64,
}

/// `1/(1 + e^{-x})`, without overflow.
fn logistic(x: f64) -> f64 {
    0.5 * (1.0 + (0.5 * x).tanh())
}

impl VelocityFunction for Sigmoid {
    fn value(&self, dq: f64) -> f64 {
        logistic(self.steepness * (dq + self.offset_speed)) - logistic(self.steepness * self.offset_speed)
    }

    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        let at_rest = logistic(self.steepness * self.offset_speed);
        let mut middle = [0.0; PART];
        for (dq, out) in motion.dq_of(joint).chunks(PART).zip(out.chunks_mut(PART)) {
            middle.iter_mut().zip(dq).for_each(|(to, dq)| *to = dq + self.offset_speed);
            tanh_all(&middle[..dq.len()], 2.0 / self.steepness, out);
            for tanh in out.iter_mut() {
                *tanh = 0.5 * (1.0 + *tanh) - at_rest;
            }
        }
    }

    fn slope(&self, dq: f64) -> f64 {
        let share = logistic(self.steepness * (dq + self.offset_speed));
        self.steepness * share * (1.0 - share)
    }
}

impl TermKind for Sigmoid {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "sigmoid", symbol: format!("sig{}", self.joint + 1), unit: "Nm" }
    }

    smooth_friction!();

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("steepness", TermConstant::Number(self.steepness)),
            ("offset_speed", TermConstant::Number(self.offset_speed)),
        ]
    }

    column_of_velocity!();
}
