//! Friction by a power of the speed, rounded at rest: `τ = F q̇ (q̇² + ε²)^{(p-1)/2}`, which is `F |q̇|^p sign(q̇)` for speeds well above `ε`.
//!
//! `p = 1/3`: the sub-linear losses of harmonic drives. `p = 2`: churning lubricant. The rounding keeps the slope finite at rest, where that of a cube root is not.

/// Friction of one joint by a power of its speed, Nm (s/rad)^p.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    /// The joint.
    pub joint: usize,
    /// Which power.
    pub exponent: PowerExponent,
    /// Speed `ε` of the rounding, rad/s or m/s, positive.
    pub rounding: f64,
}

impl Power {
    /// The rounding that is usual: below any velocity that a differentiated encoder tells from rest, rad/s or m/s.
    pub const ROUNDING: f64 = 1.0e-3;
}

/// The powers in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

impl Power {
    pub(super) fn value(self, dq: f64) -> f64 {
        dq * dq.hypot(self.rounding).powf(self.exponent.value() - 1.0)
    }

    pub(super) fn slope(self, dq: f64) -> f64 {
        let (p, size) = (self.exponent.value(), dq.hypot(self.rounding));
        let share = dq / size;
        size.powf(p - 1.0) * (1.0 + (p - 1.0) * share * share)
    }
}
