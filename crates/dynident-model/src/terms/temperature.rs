//! Friction that changes with temperature T: `τ = F_vT (T − T₀) q̇` and `τ = F_cT (T − T₀) s(q̇)` with a smoothed or
//! unsmoothed sign function `s`.
//!
//! The terms are added to viscous and Coulomb friction, whose coefficients then apply at the reference temperature
//! T₀: `F_v(T) = F_v + F_vT (T − T₀)`. Grease viscosity decreases with temperature, so F_vT is usually negative, but
//! both signs are physically possible. The temperature is passed together with the motion (see
//! [`TermInput`](super::TermInput)); without it the joint is assumed to be at T₀ and the column is zero. The linear
//! law is valid for a range of about 20 K; beyond it the viscous part decreases exponentially. Source: Bittencourt
//! and Axelsson, IEEE/ASME Trans. Mechatronics 19 (2014) 1484; Simoni et al., IFAC PapersOnLine 48 (2015) 183.

use super::kind::{TermAction, TermConstant, TermJoints, TermKind, TermLabel};
use super::law::{Law, VelocityLaw};
use super::stated::{StatedFault, StatedJoint, StudyLaw, check};
use super::{CoulombShape, FrictionTerm, JointMotion, TermInput, TorqueTerm};
use serde::{Deserialize, Serialize};

/// Change of viscous friction with temperature, Nm s/(rad K) (N s/(m K)).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TemperatureViscous {
    /// The joint.
    pub joint: usize,
    /// Reference temperature T₀, °C.
    pub reference_c: f64,
}

/// Change of Coulomb friction with temperature, Nm/K (N/K).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TemperatureCoulomb {
    /// The joint.
    pub joint: usize,
    /// Reference temperature T₀, °C.
    pub reference_c: f64,
    /// The smoothed or unsmoothed sign function.
    pub shape: CoulombShape,
}

impl TemperatureViscous {
    /// `(T − T₀) q̇`: torque per unit of the parameter at the temperature `temperature_c` (°C) and velocity `dq`.
    pub fn value(self, temperature_c: f64, dq: f64) -> f64 {
        (temperature_c - self.reference_c) * dq
    }
}

impl TemperatureCoulomb {
    /// `(T − T₀) s(q̇)`: torque per unit of the parameter at the temperature `temperature_c` (°C) and velocity `dq`.
    pub fn value(self, temperature_c: f64, dq: f64) -> f64 {
        (temperature_c - self.reference_c) * self.shape.step(dq)
    }
}

impl VelocityLaw for TemperatureViscous {}

impl Law for TemperatureViscous {}

impl VelocityLaw for TemperatureCoulomb {}

impl Law for TemperatureCoulomb {}

/// The law `temperature` of a study: friction that changes with temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StatedTemperature {
    /// Reference temperature of `viscous` and `coulomb`, °C; 25 by default.
    #[serde(default = "room_temperature")]
    pub reference_c: f64,
    /// Whether viscous friction depends on temperature. True by default.
    #[serde(default = "yes")]
    pub viscous: bool,
    /// Whether Coulomb friction depends on temperature. True by default.
    #[serde(default = "yes")]
    pub coulomb: bool,
}

fn room_temperature() -> f64 {
    25.0
}

fn yes() -> bool {
    true
}

impl StudyLaw for StatedTemperature {
    fn terms(&self, own: &StatedJoint) -> Vec<TorqueTerm> {
        let (joint, reference_c, shape) = (own.joint, self.reference_c, own.step);
        let viscous = TorqueTerm::TemperatureViscous(TemperatureViscous { joint, reference_c });
        let coulomb = TorqueTerm::TemperatureCoulomb(TemperatureCoulomb { joint, reference_c, shape });
        [self.viscous.then_some(viscous), self.coulomb.then_some(coulomb)].into_iter().flatten().collect()
    }

    fn check(&self) -> Result<(), StatedFault> {
        if !self.viscous && !self.coulomb {
            let (problem, fix) = ("neither viscous nor coulomb changes", "leave the law out");
            return Err(StatedFault::Empty { problem, fix });
        }
        check("reference_c", self.reference_c, [-273.15, 1.0e3])
    }

    fn needs_temperature(&self) -> bool {
        true
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
        vec![("reference_c", TermConstant::Number(self.reference_c, ""))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        by_temperature(self.joint, motion, input.temperature_c, out, |t, dq| self.value(t, dq));
    }

    fn stated(&self) -> Option<FrictionTerm> {
        let reference_c = self.reference_c;
        Some(FrictionTerm::Temperature(StatedTemperature { reference_c, viscous: true, coulomb: false }))
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
        vec![("reference_c", TermConstant::Number(self.reference_c, "")), ("shape", TermConstant::Step(self.shape))]
    }

    fn column(&self, _: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        by_temperature(self.joint, motion, input.temperature_c, out, |t, dq| self.value(t, dq));
    }

    fn stated(&self) -> Option<FrictionTerm> {
        let reference_c = self.reference_c;
        Some(FrictionTerm::Temperature(StatedTemperature { reference_c, viscous: false, coulomb: true }))
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        Some(&mut self.shape)
    }
}

/// Regressor column from temperature and velocity at every sample; zero without a temperature.
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
