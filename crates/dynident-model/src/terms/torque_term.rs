//! Methods of all torque terms.

use super::kind::{TermAction, TermConstant, TermJoints};
use super::{
    CoulombShape, HysteresisState, JointMotion, JointProperty, MotionFunction, StateFunction, TermInput, TorqueTerm,
};
use crate::tree::Model;

impl TorqueTerm {
    /// Name of the kind: `viscous`, `coulomb`, `maxwell-slip`, ..
    pub fn kind_name(&self) -> &'static str {
        self.kind().label().kind
    }

    /// Symbol of the parameter, as in the literature, with the number of the joint counted from 1 (`fv3`).
    pub fn symbol(&self) -> String {
        self.kind().label().symbol
    }

    /// Unit of the parameter at a revolute joint.
    pub fn unit(&self) -> &str {
        self.kind().label().unit
    }

    /// Constants by name; joints and parameter are not included.
    pub fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        self.kind().constants()
    }

    /// The same law with another sign function near zero velocity, if it has one.
    #[must_use]
    pub fn with_step(mut self, other: impl Fn(CoulombShape) -> CoulombShape) -> Self {
        if let Some(step) = self.kind_mut().step_mut() {
            *step = other(*step);
        }
        self
    }

    /// The sign function near zero velocity, if the law has one.
    pub fn step(&self) -> Option<CoulombShape> {
        self.constants().into_iter().find_map(|(_, constant)| match constant {
            TermConstant::Step(step) => Some(step),
            _ => None,
        })
    }

    /// Width of the smoothed sign function, rad/s (m/s), 0 if it is not smoothed; `None` for a law without a sign
    /// function.
    pub fn step_width(&self) -> Option<f64> {
        self.constants().into_iter().find_map(|(name, constant)| match constant {
            TermConstant::Step(CoulombShape::Smooth { width }) => Some(width),
            TermConstant::Step(CoulombShape::Sign { .. }) => Some(0.0),
            TermConstant::Number(value, _) => self.kind().step_width_by(name, value),
            _ => None,
        })
    }

    /// The term with its constants set to these coordinates, within bounds; `velocity` corresponds to 1 rad/s (m/s) of
    /// a typical arm.
    #[must_use]
    pub fn at(&self, coordinates: &[f64], velocity: f64) -> Self {
        let mut term = self.clone();
        term.kind_mut().move_to(coordinates, velocity);
        term
    }

    /// Name of the constant of a coordinate, and its value at these coordinates.
    pub fn constant_at(&self, place: usize, coordinates: &[f64], velocity: f64) -> (&'static str, f64) {
        match self.at(coordinates, velocity).constants().get(place) {
            Some((name, TermConstant::Number(value, _))) => (name, *value),
            _ => ("width", coordinates[place].exp()),
        }
    }

    /// Joints on which the term acts.
    pub fn joints(&self) -> Vec<usize> {
        match self.kind().joints() {
            TermJoints::One(joint) => vec![joint],
            TermJoints::Two(first, second) => vec![first, second],
        }
    }

    /// The only joint on which the term acts; `None` for a drive that is coupled to two joints.
    pub fn own_joint(&self) -> Option<usize> {
        match self.kind().joints() {
            TermJoints::One(joint) => Some(joint),
            TermJoints::Two(..) => None,
        }
    }

    /// True if the term acts on joint `joint`. Does not allocate, unlike [`joints`](TorqueTerm::joints).
    pub fn acts_on(&self, joint: usize) -> bool {
        match self.kind().joints() {
            TermJoints::One(own) => own == joint,
            TermJoints::Two(first, second) => first == joint || second == joint,
        }
    }

    /// Effect of the term in the equation of motion.
    pub fn action(&self) -> TermAction<'_> {
        self.kind().action()
    }

    /// Functions of the motion that friction and declared torques add; empty for inertia and offset.
    pub fn functions(&self) -> Vec<MotionFunction> {
        self.kind().functions()
    }

    /// Corresponding property of the joint in a robot description.
    pub fn property(&self) -> Option<JointProperty> {
        self.kind().property()
    }

    /// Nominal value of the parameter in the description of `model`, if any; for a declared torque, the declared value.
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

    /// True if a negative parameter is physically impossible: friction dissipates power at every velocity, and
    /// inertia is positive. An offset or a change with temperature can have either sign. The cross terms of a
    /// coupling are checked together with their drive.
    pub fn is_nonnegative(&self) -> bool {
        self.kind().is_nonnegative()
    }

    /// True if the column needs the joint's temperature.
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

    /// True if the column needs the torque that the joint transmits.
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

    /// Function of positions and velocities of a declared torque; `None` for all other terms.
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

    /// First sample of a motion at which a declared torque is undefined: its expression has no value there, or the
    /// position is outside its table. The column is zero at such a sample, or has the last value of the table.
    pub fn undefined(&self, motion: &JointMotion<'_>) -> Option<usize> {
        self.state_function()?.first_outside(motion)
    }

    /// True if the column depends on earlier samples (hysteresis).
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

    /// True for friction of one joint or of a shared drive: all terms except inertia, offset and declared torques.
    pub fn is_friction(&self) -> bool {
        match self.action() {
            TermAction::Inertia { .. } | TermAction::Constant | TermAction::State(_) => false,
            TermAction::Damping { .. } | TermAction::Friction(_) | TermAction::Hysteresis | TermAction::Temperature => {
                true
            }
        }
    }

    /// True for friction of one joint: all terms except offset, drive inertia, couplings and declared torques.
    pub fn is_joint_friction(&self) -> bool {
        self.is_friction() && self.own_joint().is_some()
    }

    /// True for the drive inertia of one joint.
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

    /// Computes the regressor column of this parameter in the row of joint `row`: `out[s] = ∂τ_row/∂parameter` at
    /// sample `s`. The block is treated as a separate recording, without known transmitted torque or temperature;
    /// otherwise use [`column_following`](TorqueTerm::column_following).
    ///
    /// # Panics
    /// If `row` is not one of [`joints`](TorqueTerm::joints) or `out` is not one value per sample.
    pub fn column(&self, row: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        let mut input = TermInput { load: None, temperature_c: None, memory: &mut HysteresisState::default() };
        self.column_following(row, motion, &mut input, out);
    }

    /// Computes the regressor column like [`column`](TorqueTerm::column), for a block that continues a recording. A
    /// simulation passes blocks of one sample.
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

    /// Adds the derivatives of `Σ weights[s] · column[s]` with respect to positions, velocities and accelerations to
    /// the three parts of `gradient` (joint-major). `column` is that of [`column`](TorqueTerm::column) in the row of
    /// joint `row`. An unsmoothed sign function and the deflection of a Maxwell-slip element are treated as constant.
    ///
    /// # Panics
    /// If lengths differ.
    pub fn apply_adjoint(&self, row: usize, motion: &JointMotion<'_>, weights: &[f64], gradient: [&mut [f64]; 3]) {
        assert_eq!(weights.len(), motion.samples);
        self.kind().apply_adjoint(row, motion, weights, gradient);
    }

    /// Contribution of this parameter to entry (`row`, `column`) of the mass matrix: a constant, zero for friction.
    pub fn mass_matrix_entry(&self, row: usize, column: usize) -> f64 {
        let entry = match self.kind().joints() {
            TermJoints::One(joint) => (row, column) == (joint, joint),
            TermJoints::Two(first, second) => (row, column) == (first, second) || (row, column) == (second, first),
        };
        self.mass_matrix_factor().filter(|_| entry).unwrap_or(0.0)
    }

    /// Contribution of this parameter to the torque of joint `row` at rest: a constant, one for the offset of that
    /// joint.
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
