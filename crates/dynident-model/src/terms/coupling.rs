//! A drive that is coupled to two joints, as in a coupled wrist: its velocity is `w = k_1 q̇_1 + k_2 q̇_2`.
//!
//! The terms of each joint already contain the part that depends on one joint alone, so a coupling contains the cross
//! terms (Stäubli TX and RX wrists: Gautier, Janot, Vandanjon 2013; a rotor coupled to both joints of the DFKI
//! pendulum):
//! * inertia: `τ_1 += k_1 k_2 I q̈_2`, `τ_2 += k_1 k_2 I q̈_1`,
//! * viscous friction: `τ_1 += k_1 k_2 F q̇_2`, `τ_2 += k_1 k_2 F q̇_1`,
//! * Coulomb friction: `τ_1 += k_1 F s(w)`, `τ_2 += k_2 F s(w)`.

use super::kind::{MotionFunction, TermAction, TermConstant, TermJoints, TermKind, TermLabel, VelocityFriction};
use super::law::{Law, VelocityLaw};
use super::{Coulomb, CoulombShape, DriveInertia, JointMotion, TermInput, TorqueTerm, Viscous};
use dynident_lanes::Real;
use serde::{Deserialize, Serialize};

/// Effect of a shared drive on its two joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum CouplingEffect {
    /// Cross term of inertia, kg m².
    Inertia,
    /// Cross term of viscous friction, Nm s/rad.
    Viscous,
    /// Coulomb friction by the drive's velocity, Nm.
    Coulomb(CoulombShape),
}

impl CouplingEffect {
    /// Returns the term that corresponds to this effect for a drive of a single joint with the velocity ratio
    /// `ratio`, and the parameter of the term per unit of the drive's parameter.
    pub fn of_joint(self, joint: usize, ratio: f64) -> (TorqueTerm, f64) {
        match self {
            Self::Inertia => (TorqueTerm::DriveInertia(DriveInertia { joint }), ratio * ratio),
            Self::Viscous => (TorqueTerm::Viscous(Viscous { joint }), ratio * ratio),
            Self::Coulomb(shape) => (TorqueTerm::Coulomb(Coulomb { joint, shape }), ratio.abs()),
        }
    }
}

/// One effect of one drive that is coupled to two joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Coupling {
    /// Name of the drive, used in the parameter's symbol.
    pub name: String,
    /// Index of one joint.
    pub first: usize,
    /// Index of the other joint.
    pub second: usize,
    /// Drive velocity divided by the velocity of the first and of the second joint.
    pub ratios: [f64; 2],
    /// Effect of the drive.
    pub effect: CouplingEffect,
}

impl Coupling {
    /// Valid magnitudes of a ratio: they include all real gears, and products of two ratios stay within the range of
    /// `f64`.
    pub const RATIOS: core::ops::RangeInclusive<f64> = 1e-6..=1e6;

    /// For joint `row`, the other joint and its ratio.
    fn as_seen_by(&self, row: usize) -> (usize, f64) {
        if row == self.first { (self.second, self.ratios[0]) } else { (self.first, self.ratios[1]) }
    }
}

impl VelocityLaw for Coupling {}

impl Law for Coupling {
    fn torque<S: Real>(&self, row: usize, dq: &[S]) -> Result<S, &'static str> {
        let (other, own_ratio) = self.as_seen_by(row);
        let [first, second] = self.ratios.map(S::splat);
        Ok(match self.effect {
            CouplingEffect::Inertia => S::ZERO,
            CouplingEffect::Viscous => first * second * dq[other],
            CouplingEffect::Coulomb(shape) => {
                S::splat(own_ratio) * shape.of(first * dq[self.first] + second * dq[self.second])
            }
        })
    }
}

impl TermKind for Coupling {
    fn label(&self) -> TermLabel<'_> {
        let (letters, unit) = match self.effect {
            CouplingEffect::Inertia => ("Ia", "kg m^2"),
            CouplingEffect::Viscous => ("fv", "Nm s/rad"),
            CouplingEffect::Coulomb(_) => ("fc", "Nm"),
        };
        TermLabel { kind: "coupling", symbol: format!("{letters}_{}", self.name), unit }
    }

    fn joints(&self) -> TermJoints {
        TermJoints::Two(self.first, self.second)
    }

    fn is_nonnegative(&self) -> bool {
        // Cross terms can be negative; they are checked together with their drive.
        false
    }

    fn action(&self) -> TermAction<'_> {
        let factor = self.ratios[0] * self.ratios[1];
        match &self.effect {
            CouplingEffect::Inertia => TermAction::Inertia { factor },
            CouplingEffect::Viscous => TermAction::Damping { factor },
            CouplingEffect::Coulomb(shape) => {
                TermAction::Friction(VelocityFriction { ratios: self.ratios, ..VelocityFriction::of(shape.curve()) })
            }
        }
    }

    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        let (effect, shape) = match self.effect {
            CouplingEffect::Inertia => ("inertia", TermConstant::Nothing),
            CouplingEffect::Viscous => ("viscous", TermConstant::Nothing),
            CouplingEffect::Coulomb(shape) => ("coulomb", TermConstant::Step(shape)),
        };
        vec![("effect", TermConstant::Word(effect)), ("ratios", TermConstant::Numbers(self.ratios)), ("shape", shape)]
    }

    fn column(&self, row: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        let (other, own_ratio) = self.as_seen_by(row);
        let cross = self.ratios[0] * self.ratios[1];
        match self.effect {
            CouplingEffect::Inertia => {
                for (to, &ddq) in out.iter_mut().zip(motion.ddq_of(other)) {
                    *to = cross * ddq;
                }
            }
            CouplingEffect::Viscous => {
                for (to, &dq) in out.iter_mut().zip(motion.dq_of(other)) {
                    *to = cross * dq;
                }
            }
            CouplingEffect::Coulomb(shape) => {
                let speeds = motion.dq_of(self.first).iter().zip(motion.dq_of(self.second));
                for (to, (&first, &second)) in out.iter_mut().zip(speeds) {
                    *to = own_ratio * shape.step(self.ratios[0] * first + self.ratios[1] * second);
                }
            }
        }
    }

    fn apply_adjoint(&self, row: usize, motion: &JointMotion<'_>, weights: &[f64], adjoints: [&mut [f64]; 3]) {
        let [_, by_dq, by_ddq] = adjoints;
        let (other, own_ratio) = self.as_seen_by(row);
        let cross = self.ratios[0] * self.ratios[1];
        let start = |joint: usize| joint * motion.samples;
        for (s, w) in weights.iter().enumerate() {
            match self.effect {
                CouplingEffect::Inertia => by_ddq[start(other) + s] += cross * w,
                CouplingEffect::Viscous => by_dq[start(other) + s] += cross * w,
                CouplingEffect::Coulomb(shape) => {
                    let speed =
                        self.ratios[0] * motion.dq_of(self.first)[s] + self.ratios[1] * motion.dq_of(self.second)[s];
                    let slope = own_ratio * shape.slope(speed) * w;
                    by_dq[start(self.first) + s] += self.ratios[0] * slope;
                    by_dq[start(self.second) + s] += self.ratios[1] * slope;
                }
            }
        }
    }

    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        match &mut self.effect {
            CouplingEffect::Coulomb(shape) => Some(shape),
            CouplingEffect::Inertia | CouplingEffect::Viscous => None,
        }
    }

    fn functions(&self) -> Vec<MotionFunction> {
        let both = |of_first: String, of_second: String, factors: [f64; 2]| {
            let rows = [(self.first, of_first, factors[0]), (self.second, of_second, factors[1])];
            rows.map(|(row, function, factor)| MotionFunction { row, function, factor }).into()
        };
        match self.effect {
            CouplingEffect::Inertia => Vec::new(),
            CouplingEffect::Viscous => {
                let of_other = |other: usize| format!("viscous of joint {other}");
                let cross = self.ratios[0] * self.ratios[1];
                both(of_other(self.second), of_other(self.first), [cross; 2])
            }
            CouplingEffect::Coulomb(shape) => {
                let function = format!("{:?}", (self.first, self.second, self.ratios, shape));
                both(function.clone(), function, self.ratios)
            }
        }
    }
}
