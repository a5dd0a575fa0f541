//! Coulomb friction: `τ = F_c s(q̇)` with a sign or a smooth step `s`.

use super::JointMotion;
use super::kind::{
    JointProperty, MotionFunction, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityCurve,
    VelocityFriction, VelocityFunction, column_of_velocity, halves,
};
use dynident_lanes::tanh_all;
use serde::{Deserialize, Serialize};

/// The step near zero velocity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CoulombShape {
    /// `sign(q̇)`, and zero while `|q̇|` is at most `dead_band` (rad/s or m/s; may be zero).
    Sign {
        /// Half width of the band without friction torque.
        dead_band: f64,
    },
    /// `tanh(q̇ / width)`: no chatter of the sign of a noisy velocity near rest.
    Smooth {
        /// Velocity at which 76 % of the step is reached, rad/s or m/s, positive.
        width: f64,
    },
}

impl CoulombShape {
    /// The width of a smooth step that is usual, rad/s or m/s of a usual arm
    /// ([`OwnScale::velocity`](crate::OwnScale::velocity)).
    pub const USUAL_WIDTH: f64 = 0.02;

    /// The step at velocity `dq`.
    #[inline]
    pub fn step(self, dq: f64) -> f64 {
        match self {
            Self::Sign { dead_band } if dq.abs() <= dead_band => 0.0,
            Self::Sign { .. } => dq.signum(),
            Self::Smooth { width } => (dq / width).tanh(),
        }
    }

    /// The steps at the velocities `dq`, several at a time.
    pub(super) fn steps(self, dq: &[f64], out: &mut [f64]) {
        match self {
            Self::Sign { .. } => out.iter_mut().zip(dq).for_each(|(to, &dq)| *to = self.step(dq)),
            Self::Smooth { width } => tanh_all(dq, width, out),
        }
    }

    /// The step's derivative by the velocity; zero for the sign, which has none at the step.
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

    /// As friction of a robot. The dead band of a sign is a device for noisy velocities of a log: a robot has none.
    pub(super) fn curve(&self) -> VelocityCurve<'_> {
        match self {
            Self::Sign { .. } => VelocityCurve::Step { forward: true, backward: true },
            Self::Smooth { .. } => VelocityCurve::Smooth(self),
        }
    }
}

impl VelocityFunction for CoulombShape {
    fn value(&self, dq: f64) -> f64 {
        self.step(dq)
    }

    fn slope(&self, dq: f64) -> f64 {
        CoulombShape::slope(*self, dq)
    }

    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        self.steps(motion.dq_of(joint), out);
    }
}

/// Coulomb friction of one joint, Nm (N).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Coulomb {
    /// The joint.
    pub joint: usize,
    /// The step near zero velocity.
    pub shape: CoulombShape,
}

impl TermKind for Coulomb {
    fn label(&self) -> TermLabel<'_> {
        TermLabel { kind: "coulomb", symbol: format!("fc{}", self.joint + 1), unit: "Nm" }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::One(self.joint)
    }

    fn is_nonnegative(&self) -> bool {
        true
    }

    fn action(&self) -> TermAction<'_> {
        TermAction::Friction(VelocityFriction::of(self.shape.curve()))
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        vec![("shape", TermConstant::Step(self.shape))]
    }

    column_of_velocity!(shape);

    fn functions(&self) -> Vec<MotionFunction> {
        halves(self.joint, &format!("{:?}", self.shape)).into()
    }

    fn property(&self) -> Option<JointProperty> {
        Some(JointProperty::Friction)
    }
}
