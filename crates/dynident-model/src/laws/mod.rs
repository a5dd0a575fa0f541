//! Laws beyond rigid bodies: friction, drive inertia, offsets, couplings. Each law is one parameter and one regressor column per
//! joint that feels it; each kind is one file here and one line in [`Law`].

mod coulomb;
mod coupling;
mod directional;
mod drive_inertia;
mod load;
mod offset;
mod order;
mod power;
mod sigmoid;
mod slip;
mod stribeck;
mod temperature;
mod viscous;

pub use coulomb::{Coulomb, CoulombShape};
pub use coupling::{Coupling, CouplingEffect};
pub use directional::{Direction, DirectionalCoulomb, DirectionalViscous};
pub use drive_inertia::DriveInertia;
pub use load::LoadFriction;
pub use offset::Offset;
pub use order::sort_terms;
pub use power::{Power, PowerExponent};
pub use sigmoid::Sigmoid;
pub use slip::{LawMemory, MaxwellSlip};
pub use stribeck::Stribeck;
pub use temperature::{TemperatureCoulomb, TemperatureViscous};
pub use viscous::Viscous;

use crate::tree::Model;
use directional::by_speed;
use temperature::by_temperature;

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

/// What a law is given beside the motion of a block.
#[derive(Debug)]
pub struct LawInput<'a> {
    /// The load of the law's joint sample by sample, Nm (N), where it is known.
    pub load: Option<&'a [f64]>,
    /// The temperature of the law's joint sample by sample, °C, where it was measured.
    pub temperature_c: Option<&'a [f64]>,
    /// What the law remembers of earlier samples; afterwards, of this block as well.
    pub memory: &'a mut LawMemory,
}

impl<'a> JointMotion<'a> {
    /// Positions of joint `joint`.
    pub fn q_of(&self, joint: usize) -> &'a [f64] {
        &self.q[joint * self.samples..(joint + 1) * self.samples]
    }

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
    /// Torque in proportion to speed, in one direction.
    DirectionalViscous(DirectionalViscous),
    /// Torque by the sign of the speed, in one direction.
    DirectionalCoulomb(DirectionalCoulomb),
    /// More torque near rest.
    Stribeck(Stribeck),
    /// A shifted smooth step.
    Sigmoid(Sigmoid),
    /// Torque by a power of the speed.
    Power(Power),
    /// Torque in proportion to the load, against the motion.
    Load(LoadFriction),
    /// A spring that slips: hysteresis.
    MaxwellSlip(MaxwellSlip),
    /// Viscous friction's change with the temperature.
    TemperatureViscous(TemperatureViscous),
    /// Coulomb friction's change with the temperature.
    TemperatureCoulomb(TemperatureCoulomb),
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
            Self::DirectionalViscous(law) => format!("fv{}{}", law.joint + 1, law.direction.sign()),
            Self::DirectionalCoulomb(law) => format!("fc{}{}", law.joint + 1, law.direction.sign()),
            Self::Stribeck(law) => format!("fs{}", law.joint + 1),
            Self::Sigmoid(law) => format!("sig{}", law.joint + 1),
            Self::Power(Power { joint, exponent: PowerExponent::CubeRoot, .. }) => format!("fr{}", joint + 1),
            Self::Power(Power { joint, exponent: PowerExponent::Quadratic, .. }) => format!("fq{}", joint + 1),
            Self::Load(law) => format!("fl{}", law.joint + 1),
            Self::MaxwellSlip(law) => format!("slip{}_{}", law.joint + 1, law.yield_displacement),
            Self::TemperatureViscous(law) => format!("fvT{}", law.joint + 1),
            Self::TemperatureCoulomb(law) => format!("fcT{}", law.joint + 1),
            Self::Offset(law) => format!("off{}", law.joint + 1),
            Self::DriveInertia(law) => format!("Ia{}", law.joint + 1),
            Self::Coupling(law) => law.symbol(),
        }
    }

    /// Unit of the parameter at a turning joint.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Viscous(_)
            | Self::DirectionalViscous(_)
            | Self::Coupling(Coupling { effect: CouplingEffect::Viscous, .. }) => "Nm s/rad",
            Self::Power(Power { exponent: PowerExponent::CubeRoot, .. }) => "Nm (s/rad)^(1/3)",
            Self::Power(Power { exponent: PowerExponent::Quadratic, .. }) => "Nm (s/rad)^2",
            Self::Load(_) => "1",
            Self::TemperatureViscous(_) => "Nm s/(rad K)",
            Self::TemperatureCoulomb(_) => "Nm/K",
            Self::Coulomb(_)
            | Self::DirectionalCoulomb(_)
            | Self::Stribeck(_)
            | Self::Sigmoid(_)
            | Self::MaxwellSlip(_)
            | Self::Offset(_)
            | Self::Coupling(Coupling { effect: CouplingEffect::Coulomb(_), .. }) => "Nm",
            Self::DriveInertia(_) | Self::Coupling(Coupling { effect: CouplingEffect::Inertia, .. }) => "kg m^2",
        }
    }

    /// The one joint that the law belongs to; none for a drive that turns with two.
    fn own_joint(&self) -> Option<usize> {
        Some(match self {
            Self::Viscous(law) => law.joint,
            Self::Coulomb(law) => law.joint,
            Self::DirectionalViscous(law) => law.joint,
            Self::DirectionalCoulomb(law) => law.joint,
            Self::Stribeck(law) => law.joint,
            Self::Sigmoid(law) => law.joint,
            Self::Power(law) => law.joint,
            Self::Load(law) => law.joint,
            Self::MaxwellSlip(law) => law.joint,
            Self::TemperatureViscous(law) => law.joint,
            Self::TemperatureCoulomb(law) => law.joint,
            Self::Offset(law) => law.joint,
            Self::DriveInertia(law) => law.joint,
            Self::Coupling(_) => return None,
        })
    }

    /// The joints that feel this law.
    pub fn joints(&self) -> Vec<usize> {
        match self {
            Self::Coupling(law) => vec![law.first, law.second],
            _ => self.own_joint().into_iter().collect(),
        }
    }

    /// True when joint `joint` feels this law. Allocates nothing, unlike [`joints`](Law::joints).
    pub fn acts_on(&self, joint: usize) -> bool {
        match self {
            Self::Coupling(law) => law.first == joint || law.second == joint,
            _ => self.own_joint() == Some(joint),
        }
    }

    /// True when a negative parameter is not possible: friction takes power from the motion at every speed, inertia is positive. An offset may have either sign, and so may a change with temperature; a coupling's
    /// cross terms are judged with their drive.
    pub fn is_nonnegative(&self) -> bool {
        !matches!(self, Self::Offset(_) | Self::Coupling(_) | Self::TemperatureViscous(_) | Self::TemperatureCoulomb(_))
    }

    /// True when the column needs the joint's temperature.
    pub fn needs_temperature(&self) -> bool {
        matches!(self, Self::TemperatureViscous(_) | Self::TemperatureCoulomb(_))
    }

    /// True for friction of one joint: all but offset, drive inertia and couplings.
    pub fn is_joint_friction(&self) -> bool {
        !matches!(self, Self::Offset(_) | Self::DriveInertia(_) | Self::Coupling(_))
    }

    /// The regressor column of this parameter in the row of joint `row`: `out[s] = ∂τ_row/∂parameter` at sample `s`. The block counts as a recording of its own, without known
    /// load or temperature: see [`column_following`](Law::column_following).
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](Law::joints) or `out` is not one value per sample.
    pub fn column(&self, row: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        let mut input = LawInput { load: None, temperature_c: None, memory: &mut LawMemory::default() };
        self.column_following(row, motion, &mut input, out);
    }

    /// The regressor column as [`column`](Law::column), of a block that follows others: with one sample a block, what a simulation needs.
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](Law::joints), or `out`, the load or the temperature are not one value per sample.
    pub fn column_following(&self, row: usize, motion: &JointMotion<'_>, input: &mut LawInput<'_>, out: &mut [f64]) {
        assert_eq!(out.len(), motion.samples);
        assert!(self.acts_on(row), "joint {row} does not feel {}", self.symbol());
        assert!(input.temperature_c.is_none_or(|t| t.len() == motion.samples), "one temperature per sample");
        match self {
            Self::Viscous(law) => law.column(motion, out),
            Self::Coulomb(law) => law.column(motion, out),
            Self::DirectionalViscous(law) => by_speed(row, motion, out, |dq| law.value(dq)),
            Self::DirectionalCoulomb(law) => by_speed(row, motion, out, |dq| law.value(dq)),
            Self::Stribeck(law) => by_speed(row, motion, out, |dq| law.value(dq)),
            Self::Sigmoid(law) => by_speed(row, motion, out, |dq| law.value(dq)),
            Self::Power(law) => by_speed(row, motion, out, |dq| law.value(dq)),
            Self::Load(law) => {
                assert!(input.load.is_none_or(|load| load.len() == motion.samples), "one load per sample");
                law.column(motion, input.load, out);
            }
            Self::MaxwellSlip(law) => law.column(motion.q_of(row), input.memory, out),
            Self::TemperatureViscous(law) => {
                by_temperature(row, motion, input.temperature_c, out, |t, dq| law.value(t, dq));
            }
            Self::TemperatureCoulomb(law) => {
                by_temperature(row, motion, input.temperature_c, out, |t, dq| law.value(t, dq));
            }
            Self::Offset(law) => law.column(out),
            Self::DriveInertia(law) => law.column(motion, out),
            Self::Coupling(law) => law.column(row, motion, out),
        }
    }

    /// Adds to `by_dq` and `by_ddq` (joint-major) the derivatives of `Σ weights[s] · column[s]` by the speeds and accelerations, where `column` is that of
    /// [`column`](Law::column) in the row of joint `row`. The sign step counts as constant, and so does the deflection of a Maxwell-slip element, which follows positions.
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
        let slopes = |slope: &dyn Fn(f64) -> f64, by_dq: &mut [f64]| {
            for ((to, w), &dq) in by_dq[range(row)].iter_mut().zip(weights).zip(motion.dq_of(row)) {
                *to += w * slope(dq);
            }
        };
        match self {
            Self::Viscous(_) => slopes(&|_| 1.0, by_dq),
            Self::Coulomb(law) => slopes(&|dq| law.shape.slope(dq), by_dq),
            Self::DirectionalViscous(law) => slopes(&|dq| law.slope(dq), by_dq),
            Self::DirectionalCoulomb(law) => slopes(&|dq| law.slope(dq), by_dq),
            Self::Stribeck(law) => slopes(&|dq| law.slope(dq), by_dq),
            Self::Sigmoid(law) => slopes(&|dq| law.slope(dq), by_dq),
            Self::Power(law) => slopes(&|dq| law.slope(dq), by_dq),
            // Without a load or a temperature the column is zero.
            Self::Load(_)
            | Self::TemperatureViscous(_)
            | Self::TemperatureCoulomb(_)
            | Self::MaxwellSlip(_)
            | Self::Offset(_) => {}
            Self::DriveInertia(law) => {
                by_ddq[range(law.joint)].iter_mut().zip(weights).for_each(|(to, w)| *to += w);
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
