//! Coulomb friction: `τ = F_c s(q̇)` with a sign or a smooth step `s`.

use super::JointMotion;

/// The step near zero speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CoulombShape {
    /// `sign(q̇)`, and zero while `|q̇|` is at most `dead_band` (rad/s or m/s; may be zero).
    Sign {
        /// Half width of the band without friction torque.
        dead_band: f64,
    },
    /// `tanh(q̇ / width)`: no chatter of the sign of a noisy speed near rest.
    Smooth {
        /// Speed at which 76 % of the step is reached, rad/s or m/s, positive.
        width: f64,
    },
}

impl CoulombShape {
    /// The step at speed `dq`.
    #[inline]
    pub fn step(self, dq: f64) -> f64 {
        match self {
            Self::Sign { dead_band } if dq.abs() <= dead_band => 0.0,
            Self::Sign { .. } => dq.signum(),
            Self::Smooth { width } => (dq / width).tanh(),
        }
    }

    /// The step's derivative by the speed; zero for the sign, which has none at the step.
    #[inline]
    pub fn slope(self, dq: f64) -> f64 {
        match self {
            Self::Sign { .. } => 0.0,
            Self::Smooth { width } => {
                let step = (dq / width).tanh();
                (1.0 - step * step) / width
            }
        }
    }
}

/// Coulomb friction of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coulomb {
    /// The joint.
    pub joint: usize,
    /// The step near zero speed.
    pub shape: CoulombShape,
}

impl Coulomb {
    pub(super) fn column(self, motion: &JointMotion<'_>, out: &mut [f64]) {
        for (to, &dq) in out.iter_mut().zip(motion.dq_of(self.joint)) {
            *to = self.shape.step(dq);
        }
    }
}
