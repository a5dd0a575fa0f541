//! Torque terms in addition to the rigid bodies: friction, drive inertia, offsets, couplings and declared
//! (user-defined) torques. Each term has one parameter, and one regressor column for each joint on which it acts.
//! Each kind is one file and a row of [`TorqueTerm`]; a law that can be used in a study also has a row of
//! [`FrictionTerm`]. No other code lists friction laws.

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
pub use stated::{StatedFault, StatedJoint, StudyLaw};
pub use stribeck::{StatedStribeck, Stribeck};
pub use temperature::{StatedTemperature, TemperatureCoulomb, TemperatureViscous};
pub use torque_table::{TablePiece, TorqueTable, TorqueTableError};
pub use viscous::Viscous;

use crate::tree::Model;
use dynident_lanes::Real;
use law::Law;
use serde::{Deserialize, Serialize};

/// Joint motion of a block of samples, joint-major: joint `j`, sample `s` has the index `j * samples + s`.
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

/// Inputs of a term in addition to the motion of a block.
#[derive(Debug)]
pub struct TermInput<'a> {
    /// Torque that the term's joint transmits at every sample, Nm (N), if known.
    pub load: Option<&'a [f64]>,
    /// Temperature of the term's joint at every sample, °C, if measured.
    pub temperature_c: Option<&'a [f64]>,
    /// State of a term with hysteresis; this block updates it.
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

/// Declares all kinds: the enum, and functions that depend on the type of a kind.
macro_rules! torque_terms {
    ($($(#[$documentation:meta])* $kind:ident($type:ident),)*) => {
        /// A torque term with one parameter; the torque is linear in the parameter.
        #[doc(alias("friction", "torque term", "actuator"))]
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(rename_all = "kebab-case")]
        pub enum TorqueTerm {
            $($(#[$documentation])* $kind($type),)*
        }

        impl TorqueTerm {
            /// Interface of the term's kind.
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

            /// All candidate laws of the friction selection, in the order in which they are tested.
            pub fn candidates() -> impl Iterator<Item = &'static CandidateLaw> {
                [$($type::CANDIDATES),*].into_iter().flatten()
            }

            /// The entry of [`candidates`](Self::candidates) that corresponds to the term; `None` for terms that are
            /// not selected.
            pub fn candidate(&self) -> Option<&'static CandidateLaw> {
                match self {
                    $(Self::$kind(term) => term.candidate(),)*
                }
            }

            /// Torque of joint `row` per unit of the parameter at the velocities `dq`, over any scalar. Only the
            /// dependence on velocities is included. The result is zero for inertia, declared torques and (at the
            /// reference temperature) changes with temperature.
            ///
            /// # Errors
            /// The additional quantity that the term needs.
            pub fn torque<S: Real>(&self, row: usize, dq: &[S]) -> Result<S, &'static str> {
                match self {
                    $(Self::$kind(term) => term.torque(row, dq),)*
                }
            }
        }
    };
}

torque_terms! {
    /// Torque proportional to velocity.
    Viscous(Viscous),
    /// Torque that depends on the sign of the velocity.
    Coulomb(Coulomb),
    /// Torque proportional to velocity, in one direction.
    DirectionalViscous(DirectionalViscous),
    /// Torque that depends on the sign of the velocity, in one direction.
    DirectionalCoulomb(DirectionalCoulomb),
    /// Sigmoid function of the velocity.
    Sigmoid(Sigmoid),
    /// Additional torque near zero velocity.
    Stribeck(Stribeck),
    /// Torque by a power of the velocity.
    Power(Power),
    /// Torque proportional to the transmitted torque, against the motion.
    Load(LoadFriction),
    /// A spring with a slider: hysteresis.
    MaxwellSlip(MaxwellSlip),
    /// Change of viscous friction with temperature.
    TemperatureViscous(TemperatureViscous),
    /// Change of Coulomb friction with temperature.
    TemperatureCoulomb(TemperatureCoulomb),
    /// A constant torque.
    Offset(Offset),
    /// Inertia of a drive that moves with one joint.
    DriveInertia(DriveInertia),
    /// Inertia or friction of a drive that is coupled to two joints.
    Coupling(Coupling),
    /// A torque that depends on positions and velocities and that the user declares.
    Declared(Declared),
}

/// Declares all laws that can be used in a study.
macro_rules! friction_terms {
    ($($(#[$documentation:meta])* $law:ident($type:ident),)*) => {
        /// A law of `drive.laws`, in addition to `viscous`, `coulomb` and `offset`.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
        #[serde(tag = "law", rename_all = "kebab-case")]
        pub enum FrictionTerm {
            $($(#[$documentation])* $law($type),)*
        }

        impl FrictionTerm {
            /// The law with the constants given in the study.
            pub fn law(&self) -> &dyn StudyLaw {
                match self {
                    $(Self::$law(law) => law,)*
                }
            }

            /// Mutable access to [`law`](Self::law).
            pub fn law_mut(&mut self) -> &mut dyn StudyLaw {
                match self {
                    $(Self::$law(law) => law,)*
                }
            }
        }
    };
}

friction_terms! {
    /// Viscous friction with one coefficient per direction, instead of `viscous`.
    AsymmetricViscous(AsymmetricViscous),
    /// Coulomb friction with one level per direction, instead of `coulomb`. With an unsmoothed sign function it is
    /// linearly dependent on `offset`: disable one of them.
    AsymmetricCoulomb(AsymmetricCoulomb),
    /// Stribeck friction: `e^{-|dq/speed|^exponent}` times a sign function.
    Stribeck(StatedStribeck),
    /// Sigmoid function of the velocity, instead of `coulomb`.
    Sigmoid(StatedSigmoid),
    /// Torque by the cube root of the velocity.
    CubeRoot(CubeRoot),
    /// Torque by the square of the velocity.
    Quadratic(Quadratic),
    /// Torque proportional to the transmitted torque, against the motion.
    Load(StatedLoad),
    /// Change of viscous and Coulomb friction with the joint's temperature, in addition to `viscous` and `coulomb`.
    /// The logs need a `temperature` column.
    Temperature(StatedTemperature),
    /// Friction with hysteresis: Maxwell-slip elements, one per yield displacement.
    MaxwellSlip(StatedMaxwellSlip),
}

/// Terms of all joints, selected by `choose`. Joint by joint, in the usual order: drive inertia, viscous friction,
/// Coulomb friction, offset.
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

/// Selection of the terms of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveChoice {
    /// Inertia of the drive, reflected to the joint.
    pub drive_inertia: bool,
    /// Viscous friction.
    pub viscous: bool,
    /// Coulomb friction, with its smoothed or unsmoothed sign function.
    pub coulomb: Option<CoulombShape>,
    /// Constant offset.
    pub offset: bool,
}
