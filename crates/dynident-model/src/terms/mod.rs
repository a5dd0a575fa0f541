//! Terms beyond rigid bodies: friction, drive inertia, offsets, couplings, declared torques. Each term is one parameter
//! and one regressor column per joint that feels it. Each kind is one file, which holds everything about it, and a row
//! of [`TorqueTerm`]; a law that a study can state has a row of [`FrictionTerm`] as well. No other code lists friction
//! laws.

mod candidate;
mod class;
mod coulomb;
mod coupling;
mod declared;
mod directional;
mod drive_inertia;
mod expression;
mod function;
mod kind;
mod law;
mod load;
mod offset;
mod order;
mod power;
mod sigmoid;
mod slip;
mod stated;
mod stribeck;
mod temperature;
mod torque_table;
mod torque_term;
mod viscous;

pub use candidate::{CandidateJoint, CandidateLaw, CandidateRole, GridPoint};
pub use class::TermClass;
pub use coulomb::{Coulomb, CoulombShape};
pub use coupling::{Coupling, CouplingEffect};
pub use declared::{Declared, DeclaredLaw};
pub use directional::{AsymmetricCoulomb, AsymmetricViscous, Direction, DirectionalCoulomb, DirectionalViscous};
pub use drive_inertia::DriveInertia;
pub use expression::{
    Expression, ExpressionError, ExpressionFunction, ExpressionFunction2, ExpressionNode, ExpressionProblem, JointNames,
};
pub use function::{TorqueFunction, TorqueLaw};
pub use kind::{
    JointProperty, MotionFunction, StateFunction, StepRole, TermAction, TermConstant, TermJoints, TermKind, TermLabel,
    VelocityCurve, VelocityFriction, VelocityFunction,
};
pub use load::{LoadFriction, StatedLoad};
pub use offset::Offset;
pub use order::sort_terms;
pub use power::{CubeRoot, Power, PowerExponent, Quadratic};
pub use sigmoid::{Sigmoid, StatedSigmoid};
pub use slip::{HysteresisState, MaxwellSlip, StatedMaxwellSlip};
pub use stated::{StatedFault, StatedJoint, StatedLaw};
pub use stribeck::{StatedStribeck, Stribeck};
pub use temperature::{StatedTemperature, TemperatureCoulomb, TemperatureViscous};
pub use torque_table::{TablePiece, TorqueTable, TorqueTableError};
pub use viscous::Viscous;

use crate::tree::Model;
use dynident_lanes::Real;
use law::Law;
use serde::{Deserialize, Serialize};

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

/// What a term is given beside the motion of a block.
#[derive(Debug)]
pub struct TermInput<'a> {
    /// The load of the term's joint sample by sample, Nm (N), where it is known.
    pub load: Option<&'a [f64]>,
    /// The temperature of the term's joint sample by sample, °C, where it was measured.
    pub temperature_c: Option<&'a [f64]>,
    /// What the term remembers of earlier samples; afterwards, of this block as well.
    pub memory: &'a mut HysteresisState,
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

/// The one list of kinds: an enum, and what needs each kind's type.
macro_rules! torque_terms {
    ($($(#[$documentation:meta])* $kind:ident($type:ident),)*) => {
        /// One parameter of the drives, linear in the joint torques.
        #[doc(alias("friction", "torque term", "actuator"))]
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(rename_all = "kebab-case")]
        pub enum TorqueTerm {
            $($(#[$documentation])* $kind($type),)*
        }

        impl TorqueTerm {
            /// The properties of its kind.
            pub fn kind(&self) -> &dyn TermKind {
                match self {
                    $(Self::$kind(term) => term,)*
                }
            }

            fn kind_mut(&mut self) -> &mut dyn TermKind {
                match self {
                    $(Self::$kind(term) => term,)*
                }
            }

            /// All laws that recordings can choose for a joint, in the order in which they are tried.
            pub fn candidates() -> impl Iterator<Item = &'static CandidateLaw> {
                [$($type::CANDIDATES),*].into_iter().flatten()
            }

            /// Which of the [`candidates`](Self::candidates) the term belongs to; `None` where recordings do not choose
            /// it.
            pub fn candidate(&self) -> Option<&'static CandidateLaw> {
                match self {
                    $(Self::$kind(term) => term.candidate(),)*
                }
            }

            /// Torque of joint `row` per unit of the parameter at the velocities `dq`, over any scalar, as far as it
            /// follows velocities: zero for inertia and declared torques, and for a change with temperature at its
            /// reference.
            ///
            /// # Errors
            /// With what it needs in addition to the velocities.
            pub fn torque<S: Real>(&self, row: usize, dq: &[S]) -> Result<S, &'static str> {
                match self {
                    $(Self::$kind(term) => term.torque(row, dq),)*
                }
            }
        }
    };
}

torque_terms! {
    /// Torque in proportion to velocity.
    Viscous(Viscous),
    /// Torque by the sign of the velocity.
    Coulomb(Coulomb),
    /// Torque in proportion to velocity, in one direction.
    DirectionalViscous(DirectionalViscous),
    /// Torque by the sign of the velocity, in one direction.
    DirectionalCoulomb(DirectionalCoulomb),
    /// A shifted smooth step.
    Sigmoid(Sigmoid),
    /// More torque near rest.
    Stribeck(Stribeck),
    /// Torque by a power of the velocity.
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
    /// A torque of positions and velocities that the user declares.
    Declared(Declared),
}

/// The one list of laws that a study can state.
macro_rules! friction_terms {
    ($($(#[$documentation:meta])* $law:ident($type:ident),)*) => {
        /// A law of `drive.laws`, beside `viscous`, `coulomb` and `offset`.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(tag = "law", rename_all = "kebab-case")]
        pub enum FrictionTerm {
            $($(#[$documentation])* $law($type),)*
        }

        impl FrictionTerm {
            /// The terms of its law with the stated constants.
            pub fn law(&self) -> &dyn StatedLaw {
                match self {
                    $(Self::$law(law) => law,)*
                }
            }

            /// The same, to be changed.
            pub fn law_mut(&mut self) -> &mut dyn StatedLaw {
                match self {
                    $(Self::$law(law) => law,)*
                }
            }
        }
    };
}

friction_terms! {
    /// Viscous friction by direction, in place of `viscous`.
    AsymmetricViscous(AsymmetricViscous),
    /// Coulomb friction by direction, in place of `coulomb`; with a sign it says the same as `offset`, so switch one
    /// off.
    AsymmetricCoulomb(AsymmetricCoulomb),
    /// `e^{-|dq/speed|^exponent}` times the step.
    Stribeck(StatedStribeck),
    /// A shifted smooth step, in place of `coulomb`.
    Sigmoid(StatedSigmoid),
    /// Torque by the cube root of the velocity.
    CubeRoot(CubeRoot),
    /// Torque by the square of the velocity.
    Quadratic(Quadratic),
    /// Torque in proportion to the load, against the motion.
    Load(StatedLoad),
    /// Viscous and Coulomb friction change with the joint's temperature, beside `viscous` and `coulomb`; logs need a
    /// `temperature`.
    Temperature(StatedTemperature),
    /// Springs that slip, one per yield displacement.
    MaxwellSlip(StatedMaxwellSlip),
}

/// The terms of joint after joint in the project's order: drive inertia, viscous, Coulomb, offset, as far as `choose`
/// wants them.
pub fn terms_per_joint(model: &Model, mut choose: impl FnMut(usize) -> DriveChoice) -> Vec<TorqueTerm> {
    let mut terms = Vec::new();
    for joint in 0..model.dof() {
        let choice = choose(joint);
        if choice.drive_inertia {
            terms.push(TorqueTerm::DriveInertia(DriveInertia { joint }));
        }
        if choice.viscous {
            terms.push(TorqueTerm::Viscous(Viscous { joint }));
        }
        if let Some(shape) = choice.coulomb {
            terms.push(TorqueTerm::Coulomb(Coulomb { joint, shape }));
        }
        if choice.offset {
            terms.push(TorqueTerm::Offset(Offset { joint }));
        }
    }
    terms
}

/// Which terms a joint has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveChoice {
    /// Inertia of the drive, reflected to the joint.
    pub drive_inertia: bool,
    /// Viscous friction.
    pub viscous: bool,
    /// Coulomb friction and its shape near zero velocity.
    pub coulomb: Option<CoulombShape>,
    /// Constant offset.
    pub offset: bool,
}
