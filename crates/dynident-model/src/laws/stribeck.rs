//! The Stribeck effect: more friction near rest than in fast motion, `τ = F_s e^{-|q̇/v_s|^δ} s(q̇)` with a step `s`.
//!
//! Beside Coulomb friction `F_c`, `F_s` is what static friction has more. Linear in `F_s` at given `v_s` and `δ`. Source: Armstrong-Hélouvry, Dupont and Canudas de Wit,
//! Automatica 30 (1994) 1083.

use super::CoulombShape;

/// Extra friction of one joint near rest, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck {
    /// The joint.
    pub joint: usize,
    /// The speed `v_s` at which a share of 1/e is left, rad/s or m/s, positive.
    pub speed: f64,
    /// The exponent `δ`, positive; 1 to 2.8 are usual.
    pub exponent: f64,
    /// The step near zero speed.
    pub shape: CoulombShape,
}

impl Stribeck {
    pub(super) fn value(self, dq: f64) -> f64 {
        (-(dq / self.speed).abs().powf(self.exponent)).exp() * self.shape.step(dq)
    }

    pub(super) fn slope(self, dq: f64) -> f64 {
        let x = (dq / self.speed).abs();
        let share = (-x.powf(self.exponent)).exp();
        // At zero speed the step is zero and goes to zero faster than x^(δ-1) grows.
        let falling = if x > 0.0 {
            self.exponent * x.powf(self.exponent - 1.0) / self.speed * dq.signum() * self.shape.step(dq)
        } else {
            0.0
        };
        // Far out the share is zero, however large its factor.
        if share > 0.0 { share * (self.shape.slope(dq) - falling) } else { 0.0 }
    }
}
