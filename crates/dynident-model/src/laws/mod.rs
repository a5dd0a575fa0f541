//! Laws beyond rigid bodies: friction, drive inertia, offsets, couplings. Each law is one parameter and one regressor column per
//! joint that feels it; each kind is one file here and one line in [`Law`].

mod coulomb;
mod coupling;
mod drive_inertia;
mod offset;
mod viscous;

pub use coulomb::{Coulomb, CoulombShape};
pub use coupling::{Coupling, CouplingEffect};
pub use drive_inertia::DriveInertia;
pub use offset::Offset;
pub use viscous::Viscous;

use crate::tree::Model;

/// Joint motion of a block of samples, joint-major: joint `j`, sample `s` stands at `j * samples + s`.
#[derive(Clone, Copy, Debug)]
pub struct JointMotion<'a> {
    /// Number of samples.
    pub samples: usize,
    /// Positions, rad or m.
    pub q: &'a [f64],
    /// Velocities, rad/s or m/s.
    pub dq: &'a [f64],
    /// Accelerations, rad/s² or m/s².
    pub ddq: &'a [f64],
}

impl<'a> JointMotion<'a> {
    /// Velocities of joint `joint`.
    pub fn dq_of(&self, joint: usize) -> &'a [f64] {
        &self.dq[joint * self.samples..(joint + 1) * self.samples]
    }

    /// Accelerations of joint `joint`.
    pub fn ddq_of(&self, joint: usize) -> &'a [f64] {
        &self.ddq[joint * self.samples..(joint + 1) * self.samples]
    }
}

/// One parameter of the drives, linear in the joint torques.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Torque in proportion to speed.
    Viscous(Viscous),
    /// Torque by the sign of the speed.
    Coulomb(Coulomb),
    /// A constant torque.
    Offset(Offset),
    /// Inertia of a drive that turns with its joint only.
    DriveInertia(DriveInertia),
    /// Inertia or friction of a drive that turns with two joints.
    Coupling(Coupling),
}

impl Law {
    /// Readable name of the parameter: its symbol, and the joint's number from 1 (`fv3`), as in the field's papers.
    pub fn symbol(&self) -> String {
        match self {
            Self::Viscous(law) => format!("fv{}", law.joint + 1),
            Self::Coulomb(law) => format!("fc{}", law.joint + 1),
            Self::Offset(law) => format!("off{}", law.joint + 1),
            Self::DriveInertia(law) => format!("Ia{}", law.joint + 1),
            Self::Coupling(law) => law.symbol(),
        }
    }

    /// Unit of the parameter at a turning joint.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Viscous(_) | Self::Coupling(Coupling { effect: CouplingEffect::Viscous, .. }) => "Nm s/rad",
            Self::Coulomb(_)
            | Self::Offset(_)
            | Self::Coupling(Coupling { effect: CouplingEffect::Coulomb(_), .. }) => "Nm",
            Self::DriveInertia(_) | Self::Coupling(Coupling { effect: CouplingEffect::Inertia, .. }) => "kg m^2",
        }
    }

    /// The joints that feel this law.
    pub fn joints(&self) -> Vec<usize> {
        match self {
            Self::Viscous(law) => vec![law.joint],
            Self::Coulomb(law) => vec![law.joint],
            Self::Offset(law) => vec![law.joint],
            Self::DriveInertia(law) => vec![law.joint],
            Self::Coupling(law) => vec![law.first, law.second],
        }
    }

    /// True when joint `joint` feels this law. Allocates nothing, unlike [`joints`](Law::joints).
    pub fn acts_on(&self, joint: usize) -> bool {
        match self {
            Self::Viscous(law) => law.joint == joint,
            Self::Coulomb(law) => law.joint == joint,
            Self::Offset(law) => law.joint == joint,
            Self::DriveInertia(law) => law.joint == joint,
            Self::Coupling(law) => law.first == joint || law.second == joint,
        }
    }

    /// The regressor column of this parameter in the row of joint `row`: `out[s] = ∂τ_row/∂parameter` at sample `s`.
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](Law::joints) or `out` is not one value per sample.
    pub fn column(&self, row: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        assert_eq!(out.len(), motion.samples);
        assert!(self.acts_on(row), "joint {row} does not feel {}", self.symbol());
        match self {
            Self::Viscous(law) => law.column(motion, out),
            Self::Coulomb(law) => law.column(motion, out),
            Self::Offset(law) => law.column(out),
            Self::DriveInertia(law) => law.column(motion, out),
            Self::Coupling(law) => law.column(row, motion, out),
        }
    }

    /// Adds to `by_dq` and `by_ddq` (joint-major) the derivatives of `Σ weights[s] · column[s]` by the speeds and accelerations, where `column` is that of
    /// [`column`](Law::column) in the row of joint `row`. The sign step counts as constant.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn pull_back(
        &self,
        row: usize,
        motion: &JointMotion<'_>,
        weights: &[f64],
        by_dq: &mut [f64],
        by_ddq: &mut [f64],
    ) {
        assert_eq!(weights.len(), motion.samples);
        let range = |joint: usize| joint * motion.samples..(joint + 1) * motion.samples;
        let add = |to: &mut [f64], factor: f64| to.iter_mut().zip(weights).for_each(|(to, w)| *to += factor * w);
        match self {
            Self::Viscous(law) => add(&mut by_dq[range(law.joint)], 1.0),
            Self::DriveInertia(law) => add(&mut by_ddq[range(law.joint)], 1.0),
            Self::Offset(_) => {}
            Self::Coulomb(law) => {
                let speeds = motion.dq_of(law.joint);
                for ((to, w), &dq) in by_dq[range(law.joint)].iter_mut().zip(weights).zip(speeds) {
                    *to += w * law.shape.slope(dq);
                }
            }
            Self::Coupling(law) => law.pull_back(row, motion, weights, by_dq, by_ddq),
        }
    }

    /// What this parameter adds to entry (`row`, `column`) of the mass matrix: a constant, zero for friction.
    pub fn mass_matrix_entry(&self, row: usize, column: usize) -> f64 {
        match self {
            Self::DriveInertia(law) => f64::from(row == law.joint && column == law.joint),
            Self::Coupling(law) => law.mass_matrix_entry(row, column),
            _ => 0.0,
        }
    }

    /// What this parameter adds to the torque of joint `row` at rest: a constant, one for the offset of that joint.
    pub fn constant_torque(&self, row: usize) -> f64 {
        match self {
            Self::Offset(law) => f64::from(row == law.joint),
            _ => 0.0,
        }
    }
}

/// The laws of joint after joint in the project's order: drive inertia, viscous, Coulomb, offset, as far as `choose` wants them.
pub fn laws_per_joint(model: &Model, mut choose: impl FnMut(usize) -> DriveChoice) -> Vec<Law> {
    let mut laws = Vec::new();
    for joint in 0..model.dof() {
        let choice = choose(joint);
        if choice.drive_inertia {
            laws.push(Law::DriveInertia(DriveInertia { joint }));
        }
        if choice.viscous {
            laws.push(Law::Viscous(Viscous { joint }));
        }
        if let Some(shape) = choice.coulomb {
            laws.push(Law::Coulomb(Coulomb { joint, shape }));
        }
        if choice.offset {
            laws.push(Law::Offset(Offset { joint }));
        }
    }
    laws
}

/// Which laws a joint has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveChoice {
    /// Inertia of the drive, reflected to the joint.
    pub drive_inertia: bool,
    /// Viscous friction.
    pub viscous: bool,
    /// Coulomb friction and its shape near zero speed.
    pub coulomb: Option<CoulombShape>,
    /// Constant offset.
    pub offset: bool,
}
