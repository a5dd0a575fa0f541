//! Friction that changes with the temperature: `τ = F_vT (T − T₀) q̇` and `τ = F_cT (T − T₀) s(q̇)` with a step `s`.
//!
//! Beside viscous and Coulomb friction, which then are those at T₀: coefficients linear in the temperature, `F_v(T) =
//! F_v + F_vT (T − T₀)`. Grease thins as it warms, so F_vT is usually negative; either sign is physical. A term knows
//! motions only, so the temperature comes with them (see [`TermInput`](super::TermInput)); without one the joint counts
//! as being at T₀ and the column is zero. Linear in a range of some 20 K; beyond, the viscous part falls exponentially.
//! Source: Bittencourt and Axelsson, IEEE/ASME Trans. Mechatronics 19 (2014) 1484; Simoni et al., IFAC PapersOnLine 48
//! (2015) 183.

use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::{CoulombShape, JointMotion, TermInput};
use serde::{Deserialize, Serialize};

/// Change of viscous friction with temperature, Nm s/(rad K) (N s/(m K)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TemperatureViscous {
    /// The joint.
    pub joint: usize,
    /// T₀, °C.
    pub reference_c: f64,
}

/// Change of Coulomb friction with temperature, Nm/K (N/K).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TemperatureCoulomb {
    /// The joint.
    pub joint: usize,
    /// T₀, °C.
    pub reference_c: f64,
    /// The step near zero velocity.
    pub shape: CoulombShape,
}

impl TemperatureViscous {
    /// `(T − T₀) q̇`: torque per unit of the parameter at the temperature `temperature_c` (°C) and velocity `dq`.
    pub fn value(self, temperature_c: f64, dq: f64) -> f64 {
        (temperature_c - self.reference_c) * dq
    }

    /// Its derivative by the velocity.
    pub fn slope(self, temperature_c: f64) -> f64 {
        temperature_c - self.reference_c
    }
}

impl TemperatureCoulomb {
    /// `(T − T₀) s(q̇)`.
    pub fn value(self, temperature_c: f64, dq: f64) -> f64 {
        (temperature_c - self.reference_c) * self.shape.step(dq)
    }

    /// Its derivative by the velocity; zero for the sign.
    pub fn slope(self, temperature_c: f64, dq: f64) -> f64 {
        (temperature_c - self.reference_c) * self.shape.slope(dq)
    }
}

impl TermKind for TemperatureViscous {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "temperature-viscous", symbol: format!("fvT{}", self.joint + 1), unit: "Nm s/(rad K)" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        false
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Temperature
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("reference_c", TermConstant::Number(self.reference_c))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        by_temperature(self.joint, motion, input.temperature_c, out, |t, dq| self.value(t, dq));
    }

    fn apply_adjoint(&self, _: usize, _: &JointMotion<'_>, _: &[f64], _: [&mut [f64]; 3]) {
        // Without a temperature the column is zero.
    }
}

impl TermKind for TemperatureCoulomb {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "temperature-coulomb", symbol: format!("fcT{}", self.joint + 1), unit: "Nm/K" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        false
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Temperature
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("reference_c", TermConstant::Number(self.reference_c)), ("shape", TermConstant::Step(self.shape))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        by_temperature(self.joint, motion, input.temperature_c, out, |t, dq| self.value(t, dq));
    }

    fn apply_adjoint(&self, _: usize, _: &JointMotion<'_>, _: &[f64], _: [&mut [f64]; 3]) {
        // Without a temperature the column is zero.
    }
}

/// A column from temperature and velocity, sample by sample; zero without a temperature.
fn by_temperature(
    joint: usize,
    motion: &JointMotion<'_>,
    temperature_c: Option<&[f64]>,
    out: &mut [f64],
    value: impl Fn(f64, f64) -> f64,
) {
    let Some(temperature) = temperature_c else { return out.fill(0.0) };
    for ((to, &dq), &temperature) in out.iter_mut().zip(motion.dq_of(joint)).zip(temperature) {
        *to = value(temperature, dq);
    }
}
