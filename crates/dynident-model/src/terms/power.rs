//! Friction by a power of the velocity, rounded at rest: `τ = F q̇ (q̇² + ε²)^{(p-1)/2}`, which is `F |q̇|^p sign(q̇)`
//! for velocities well above `ε`.
//!
//! `p = 1/3`: the sub-linear losses of harmonic drives. `p = 2`: churning lubricant. The rounding keeps the slope
//! finite at rest, where that of a cube root is not.

use super::kind::{
    TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve, VelocityFriction, VelocityFunction,
    column_of_velocity, smooth_friction,
};
use serde::{Deserialize, Serialize};

/// Friction of one joint by a power of its velocity, Nm (s/rad)^p.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Power {
    /// The joint.
    pub joint: usize,
    /// Which power.
    pub exponent: PowerExponent,
    /// Velocity `ε` of the rounding, rad/s or m/s, positive.
    pub rounding: f64,
}

impl Power {
    /// The rounding that is usual: below any velocity that a differentiated encoder separates from rest, rad/s or m/s
    /// of a usual arm ([`OwnScale::velocity`](crate::OwnScale::velocity)).
    pub const ROUNDING: f64 = 1.0e-3;
}

/// The powers in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum PowerExponent {
    /// `p = 1/3`.
    CubeRoot,
    /// `p = 2`.
    Quadratic,
}

impl PowerExponent {
    fn value(self) -> f64 {
        match self {
            Self::CubeRoot => 1.0 / 3.0,
            Self::Quadratic => 2.0,
        }
    }
}

impl VelocityFunction for Power {
    fn value(&self, dq: f64) -> f64 {
        let square = dq * dq + self.rounding * self.rounding;
        match self.exponent {
            PowerExponent::CubeRoot => dq / square.cbrt(),
            PowerExponent::Quadratic => dq * square.sqrt(),
        }
    }

    fn slope(&self, dq: f64) -> f64 {
        let (p, size) = (self.exponent.value(), dq.hypot(self.rounding));
        let share = dq / size;
        size.powf(p - 1.0) * (1.0 + (p - 1.0) * share * share)
    }
}

impl TermKind for Power {
    fn label(&self) -> TermLabel<'_> {
        let (letters, unit) = match self.exponent {
            PowerExponent::CubeRoot => ("fr", "Nm (s/rad)^(1/3)"),
            PowerExponent::Quadratic => ("fq", "Nm (s/rad)^2"),
        };
        TermLabel { kind: "power", symbol: format!("{letters}{}", self.joint + 1), unit }
    }

    smooth_friction!();

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![
            ("exponent", TermConstant::Number(self.exponent.value())),
            ("rounding", TermConstant::Number(self.rounding)),
        ]
    }

    column_of_velocity!();
}
