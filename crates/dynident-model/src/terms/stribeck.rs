//! The Stribeck effect: more friction near rest than in fast motion, `τ = F_s e^{-|q̇/v_s|^δ} s(q̇)` with a step `s`.
//!
//! Beside Coulomb friction `F_c`, `F_s` is what static friction has more. Linear in `F_s` at given `v_s` and `δ`.
//! Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083.

use super::kind::{
    PART, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFriction, VelocityFunction,
    column_of_velocity,
};
use super::{CoulombShape, JointMotion};
use dynident_lanes::decay_all;
use serde::{Deserialize, Serialize};

/// Extra friction of one joint near rest, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Stribeck {
    /// The joint.
    pub joint: usize,
    /// The velocity `v_s` at which a share of 1/e is left, rad/s or m/s, positive.
    pub speed: f64,
    /// The exponent `δ`, positive; 1 to 2.8 are usual.
    pub exponent: f64,
    /// The step near zero velocity.
    pub shape: CoulombShape,
}

impl VelocityFunction for Stribeck {
    fn value(&self, dq: f64) -> f64 {
        (-(dq / self.speed).abs().powf(self.exponent)).exp() * self.shape.step(dq)
    }

    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        let mut decay = [0.0; PART];
        for (dq, out) in motion.dq_of(joint).chunks(PART).zip(out.chunks_mut(PART)) {
            for (to, &dq) in out.iter_mut().zip(dq) {
                let x = (dq / self.speed).abs();
                // The two usual exponents without a power.
                *to = match self.exponent {
                    1.0 => x,
                    2.0 => x * x,
                    other => x.powf(other),
                };
            }
            decay_all(out, &mut decay);
            self.shape.steps(dq, out);
            out.iter_mut().zip(&decay).for_each(|(step, share)| *step *= share);
        }
    }

    fn slope(&self, dq: f64) -> f64 {
        let x = (dq / self.speed).abs();
        let share = (-x.powf(self.exponent)).exp();
        // At zero velocity the step is zero and goes to zero faster than x^(δ-1) grows.
        let falling = if x > 0.0 {
            self.exponent * x.powf(self.exponent - 1.0) / self.speed * dq.signum() * self.shape.step(dq)
        } else {
            0.0
        };
        // Far out the share is zero, however large its factor.
        if share > 0.0 { share * (self.shape.slope(dq) - falling) } else { 0.0 }
    }
}

impl TermKind for Stribeck {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "stribeck", symbol: format!("fs{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction {
            fading: Some([self.speed, self.exponent]),
            ..VelocityFriction::of(self.shape.curve())
        })
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("speed", TermConstant::Number(self.speed)),
            ("exponent", TermConstant::Number(self.exponent)),
            ("shape", TermConstant::Step(self.shape)),
        ]
    }

    column_of_velocity!();
}
