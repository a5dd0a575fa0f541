//! Terms beyond rigid bodies: friction, drive inertia, offsets, couplings, declared torques. Each term is one parameter
//! and one regressor column per joint that feels it; each kind is one file here, which says all that there is to say of
//! it, a variant of [`TorqueTerm`] and a line in its `kind`.

mod coulomb;
mod coupling;
mod declared;
mod directional;
mod drive_inertia;
mod expression;
mod function;
mod kind;
mod load;
mod offset;
mod order;
mod power;
mod sigmoid;
mod slip;
mod stribeck;
mod temperature;
mod torque_table;
mod viscous;

pub use coulomb::{Coulomb, CoulombShape};
pub use coupling::{Coupling, CouplingEffect};
pub use declared::{Declared, DeclaredLaw};
pub use directional::{Direction, DirectionalCoulomb, DirectionalViscous};
pub use drive_inertia::DriveInertia;
pub use expression::{
    Expression, ExpressionError, ExpressionFunction, ExpressionFunction2, ExpressionNode, ExpressionProblem, JointNames,
};
pub use function::{TorqueFunction, TorqueLaw};
pub use kind::{
    JointProperty, MotionFunction, StateFunction, TermAction, TermConstant, TermJoints, VelocityCurve,
    VelocityFriction, VelocityFunction,
};
pub use load::LoadFriction;
pub use offset::Offset;
pub use order::sort_terms;
pub use power::{Power, PowerExponent};
pub use sigmoid::Sigmoid;
pub use slip::{HysteresisState, MaxwellSlip};
pub use stribeck::Stribeck;
pub use temperature::{TemperatureCoulomb, TemperatureViscous};
pub use torque_table::{TablePiece, TorqueTable, TorqueTableError};
pub use viscous::Viscous;

use crate::tree::Model;
use kind::TermKind;
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

/// One parameter of the drives, linear in the joint torques.
#[doc(alias("friction", "torque term", "actuator"))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TorqueTerm {
    /// Torque in proportion to velocity.
    Viscous(Viscous),
    /// Torque by the sign of the velocity.
    Coulomb(Coulomb),
    /// Torque in proportion to velocity, in one direction.
    DirectionalViscous(DirectionalViscous),
    /// Torque by the sign of the velocity, in one direction.
    DirectionalCoulomb(DirectionalCoulomb),
    /// More torque near rest.
    Stribeck(Stribeck),
    /// A shifted smooth step.
    Sigmoid(Sigmoid),
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

impl TorqueTerm {
    /// The one place that knows all kinds.
    fn kind(&self) -> &dyn TermKind {
        match self {
            Self::Viscous(term) => term,
            Self::Coulomb(term) => term,
            Self::DirectionalViscous(term) => term,
            Self::DirectionalCoulomb(term) => term,
            Self::Stribeck(term) => term,
            Self::Sigmoid(term) => term,
            Self::Power(term) => term,
            Self::Load(term) => term,
            Self::MaxwellSlip(term) => term,
            Self::TemperatureViscous(term) => term,
            Self::TemperatureCoulomb(term) => term,
            Self::Offset(term) => term,
            Self::DriveInertia(term) => term,
            Self::Coupling(term) => term,
            Self::Declared(term) => term,
        }
    }

    /// Name of the kind: `viscous`, `coulomb`, `maxwell-slip`, ..
    pub fn kind_name(&self) -> &'static str {
        self.kind().label().kind
    }

    /// Readable name of the parameter: its symbol, and the joint's number from 1 (`fv3`), as in the field's papers.
    pub fn symbol(&self) -> String {
        self.kind().label().symbol
    }

    /// Unit of the parameter at a revolute joint.
    pub fn unit(&self) -> &str {
        self.kind().label().unit
    }

    /// Its constants by name, beside joints and parameter.
    pub fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        self.kind().constants()
    }

    /// The same law with another step near zero velocity, where it has one.
    #[must_use]
    pub fn with_step(self, other: impl Fn(CoulombShape) -> CoulombShape) -> Self {
        match self {
            Self::Coulomb(term) => Self::Coulomb(Coulomb { shape: other(term.shape), ..term }),
            Self::DirectionalCoulomb(term) => {
                Self::DirectionalCoulomb(DirectionalCoulomb { shape: other(term.shape), ..term })
            }
            Self::Stribeck(term) => Self::Stribeck(Stribeck { shape: other(term.shape), ..term }),
            Self::Load(term) => Self::Load(LoadFriction { shape: other(term.shape), ..term }),
            Self::TemperatureCoulomb(term) => {
                Self::TemperatureCoulomb(TemperatureCoulomb { shape: other(term.shape), ..term })
            }
            Self::Coupling(Coupling { effect: CouplingEffect::Coulomb(shape), name, first, second, ratios }) => {
                let effect = CouplingEffect::Coulomb(other(shape));
                Self::Coupling(Coupling { name, first, second, ratios, effect })
            }
            Self::Viscous(_)
            | Self::DirectionalViscous(_)
            | Self::Sigmoid(_)
            | Self::Power(_)
            | Self::MaxwellSlip(_)
            | Self::TemperatureViscous(_)
            | Self::Offset(_)
            | Self::DriveInertia(_)
            | Self::Coupling(_)
            | Self::Declared(_) => self,
        }
    }

    /// The joints that feel this term.
    pub fn joints(&self) -> Vec<usize> {
        match self.kind().joints() {
            TermJoints::One(joint) => vec![joint],
            TermJoints::Two(first, second) => vec![first, second],
        }
    }

    /// The one joint that the term belongs to; none for a drive that turns with two.
    pub fn own_joint(&self) -> Option<usize> {
        match self.kind().joints() {
            TermJoints::One(joint) => Some(joint),
            TermJoints::Two(..) => None,
        }
    }

    /// True when joint `joint` feels this term. Allocates nothing, unlike [`joints`](TorqueTerm::joints).
    pub fn acts_on(&self, joint: usize) -> bool {
        match self.kind().joints() {
            TermJoints::One(own) => own == joint,
            TermJoints::Two(first, second) => first == joint || second == joint,
        }
    }

    /// Where it enters the equation of motion.
    pub fn action(&self) -> TermAction<'_> {
        self.kind().action()
    }

    /// The functions of the motion that friction and declared torques add; none for inertia and offset.
    pub fn functions(&self) -> Vec<MotionFunction> {
        self.kind().functions()
    }

    /// The property of its joint by which a robot's description states the parameter.
    pub fn property(&self) -> Option<JointProperty> {
        self.kind().property()
    }

    /// The parameter by the description of `model`, where that says anything of it; that of a declared torque by who
    /// declared it.
    ///
    /// # Panics
    /// If the model does not have its joints.
    pub fn described(&self, model: &Model) -> Option<f64> {
        if let Self::Declared(term) = self {
            return term.nominal;
        }
        let joint = &model.joints()[self.own_joint()?];
        match self.property()? {
            JointProperty::Damping => joint.damping,
            JointProperty::Friction => joint.friction,
            JointProperty::DriveInertia => joint.drive_inertia,
            JointProperty::Stiffness => joint.spring.map(|spring| spring.stiffness),
        }
    }

    /// True when a negative parameter is not possible: friction takes power from the motion at every velocity, inertia
    /// is positive. An offset may have either sign, and so may a change with temperature; a coupling's cross terms are
    /// judged with their drive.
    pub fn is_nonnegative(&self) -> bool {
        self.kind().is_nonnegative()
    }

    /// True when the column needs the joint's temperature.
    pub fn needs_temperature(&self) -> bool {
        match self.action() {
            TermAction::Temperature => true,
            TermAction::Inertia { .. }
            | TermAction::Damping { .. }
            | TermAction::Constant
            | TermAction::Friction(_)
            | TermAction::Hysteresis
            | TermAction::State(_) => false,
        }
    }

    /// True when the column needs the joint's load.
    pub fn needs_load(&self) -> bool {
        match self.action() {
            TermAction::Friction(friction) => friction.by_load,
            TermAction::Inertia { .. }
            | TermAction::Damping { .. }
            | TermAction::Constant
            | TermAction::Hysteresis
            | TermAction::Temperature
            | TermAction::State(_) => false,
        }
    }

    /// True for a torque that the user declares.
    pub fn is_declared(&self) -> bool {
        self.state_function().is_some()
    }

    /// The function of positions and velocities that a declared torque follows; none of all other terms.
    pub fn state_function(&self) -> Option<&dyn StateFunction> {
        match self.action() {
            TermAction::State(function) => Some(function),
            TermAction::Inertia { .. }
            | TermAction::Damping { .. }
            | TermAction::Constant
            | TermAction::Friction(_)
            | TermAction::Hysteresis
            | TermAction::Temperature => None,
        }
    }

    /// The first sample of a motion of which a declared torque says nothing: its expression has no value there, or its
    /// table does not reach so far. Its column is zero there, or what the table's end says.
    pub fn undefined(&self, motion: &JointMotion<'_>) -> Option<usize> {
        self.state_function()?.first_outside(motion)
    }

    /// True when the column depends on earlier samples.
    pub fn has_memory(&self) -> bool {
        match self.action() {
            TermAction::Hysteresis => true,
            TermAction::Inertia { .. }
            | TermAction::Damping { .. }
            | TermAction::Constant
            | TermAction::Friction(_)
            | TermAction::Temperature
            | TermAction::State(_) => false,
        }
    }

    /// True for friction, of one joint or of a shared drive: all but inertia, offset and declared torques.
    pub fn is_friction(&self) -> bool {
        match self.action() {
            TermAction::Inertia { .. } | TermAction::Constant | TermAction::State(_) => false,
            TermAction::Damping { .. } | TermAction::Friction(_) | TermAction::Hysteresis | TermAction::Temperature => {
                true
            }
        }
    }

    /// True for friction of one joint: all but offset, drive inertia, couplings and declared torques.
    pub fn is_joint_friction(&self) -> bool {
        self.is_friction() && self.own_joint().is_some()
    }

    /// True for the inertia of one joint's drive.
    pub fn is_drive_inertia(&self) -> bool {
        self.mass_matrix_factor().is_some() && self.own_joint().is_some()
    }

    fn mass_matrix_factor(&self) -> Option<f64> {
        match self.action() {
            TermAction::Inertia { factor } => Some(factor),
            TermAction::Damping { .. }
            | TermAction::Constant
            | TermAction::Friction(_)
            | TermAction::Hysteresis
            | TermAction::Temperature
            | TermAction::State(_) => None,
        }
    }

    /// The regressor column of this parameter in the row of joint `row`: `out[s] = ∂τ_row/∂parameter` at sample `s`.
    /// The block counts as a recording of its own, without known load or temperature: see
    /// [`column_following`](TorqueTerm::column_following).
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](TorqueTerm::joints) or `out` is not one value per sample.
    pub fn column(&self, row: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        let mut input = TermInput { load: None, temperature_c: None, memory: &mut HysteresisState::default() };
        self.column_following(row, motion, &mut input, out);
    }

    /// The regressor column as [`column`](TorqueTerm::column), of a block that follows others: with one sample a block,
    /// what a simulation needs.
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](TorqueTerm::joints), or `out`, the load or the temperature are not one value
    /// per sample.
    pub fn column_following(&self, row: usize, motion: &JointMotion<'_>, input: &mut TermInput<'_>, out: &mut [f64]) {
        assert_eq!(out.len(), motion.samples);
        assert!(self.acts_on(row), "joint {row} does not feel {}", self.symbol());
        assert!(input.temperature_c.is_none_or(|t| t.len() == motion.samples), "one temperature per sample");
        self.kind().column(row, motion, input, out);
    }

    /// Adds to the three parts of `gradient` (joint-major) the derivatives of `Σ weights[s] · column[s]` by positions,
    /// velocities and accelerations, where `column` is that of [`column`](TorqueTerm::column) in the row of joint
    /// `row`. The sign step counts as constant, and so does the deflection of a Maxwell-slip element.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn apply_adjoint(&self, row: usize, motion: &JointMotion<'_>, weights: &[f64], gradient: [&mut [f64]; 3]) {
        assert_eq!(weights.len(), motion.samples);
        self.kind().apply_adjoint(row, motion, weights, gradient);
    }

    /// What this parameter adds to entry (`row`, `column`) of the mass matrix: a constant, zero for friction.
    pub fn mass_matrix_entry(&self, row: usize, column: usize) -> f64 {
        let entry = match self.kind().joints() {
            TermJoints::One(joint) => (row, column) == (joint, joint),
            TermJoints::Two(first, second) => (row, column) == (first, second) || (row, column) == (second, first),
        };
        self.mass_matrix_factor().filter(|_| entry).unwrap_or(0.0)
    }

    /// What this parameter adds to the torque of joint `row` at rest: a constant, one for the offset of that joint.
    pub fn constant_torque(&self, row: usize) -> f64 {
        match self.action() {
            TermAction::Constant => f64::from(self.acts_on(row)),
            TermAction::Inertia { .. }
            | TermAction::Damping { .. }
            | TermAction::Friction(_)
            | TermAction::Hysteresis
            | TermAction::Temperature
            | TermAction::State(_) => 0.0,
        }
    }
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
