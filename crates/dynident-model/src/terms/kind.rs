//! The properties that every kind of torque term defines. A kind is one type in one file that implements [`TermKind`];
//! [`TorqueTerm`](super::TorqueTerm) passes every question on to it, so that no other code has to know the kinds.

use super::candidate::velocity_within;
use super::{CoulombShape, FrictionTerm, JointMotion, TermInput, TorqueTerm};
use core::fmt::Debug;

/// The joints that feel a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermJoints {
    /// One joint.
    One(usize),
    /// Both joints that a shared drive turns with.
    Two(usize, usize),
}

/// Where a term enters the equation of motion: what its torque follows.
#[derive(Clone, Copy, Debug)]
pub enum TermAction<'a> {
    /// `factor q̈`: a constant entry of the mass matrix, that of its joint or both off the diagonal of its two joints.
    Inertia {
        /// Entry per unit of the parameter.
        factor: f64,
    },
    /// `factor q̇`, with the entries as for inertia.
    Damping {
        /// Entry per unit of the parameter.
        factor: f64,
    },
    /// The same torque always.
    Constant,
    /// Friction that follows one velocity.
    Friction(VelocityFriction<'a>),
    /// Friction that follows positions and remembers them.
    Hysteresis,
    /// Friction's change with the temperature: nothing at its reference.
    Temperature,
    /// A torque of one joint that follows the positions and velocities of any joints.
    State(&'a dyn StateFunction),
}

/// A function of positions and velocities that a user declares.
pub trait StateFunction: Debug {
    /// Its value at sample `sample` of a motion; `None` where it has none. Allocates nothing, but for code of a caller.
    fn value(&self, motion: &JointMotion<'_>, sample: usize) -> Option<f64>;

    /// Its values at all samples of a motion, NaN where it has none.
    fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]) {
        for (sample, to) in out.iter_mut().enumerate() {
            *to = self.value(motion, sample).unwrap_or(f64::NAN);
        }
    }

    /// Whether it says something of the state at sample `sample`: an expression with a value, a table that reaches so
    /// far.
    fn is_inside(&self, motion: &JointMotion<'_>, sample: usize) -> bool;

    /// The first sample of a motion that is not [inside](Self::is_inside).
    fn first_outside(&self, motion: &JointMotion<'_>) -> Option<usize> {
        (0..motion.samples).find(|&sample| !self.is_inside(motion, sample))
    }

    /// The joints whose motion it follows, ascending.
    fn follows(&self) -> Vec<usize>;

    /// It, in a few words.
    fn description(&self) -> String;
}

/// Friction that follows one velocity `w = Σ ratio q̇`; the torque of each joint is `ratio f(w)`.
#[derive(Clone, Copy, Debug)]
pub struct VelocityFriction<'a> {
    /// Of its joints; the second counts where there are two.
    pub ratios: [f64; 2],
    /// The velocity's function, before load and fading.
    pub curve: VelocityCurve<'a>,
    /// Times the absolute value of the load.
    pub by_load: bool,
    /// Times `e^{-|w/v|^δ}`, with `v` and `δ`.
    pub fading: Option<[f64; 2]>,
}

impl<'a> VelocityFriction<'a> {
    /// Friction of one joint by `curve` alone.
    pub(super) fn of(curve: VelocityCurve<'a>) -> Self {
        Self { ratios: [1.0, 0.0], curve, by_load: false, fading: None }
    }
}

/// How friction follows a velocity.
#[derive(Clone, Copy, Debug)]
pub enum VelocityCurve<'a> {
    /// A sign: at rest, anything up to one. In which directions it is felt.
    Step {
        /// At positive velocity.
        forward: bool,
        /// At negative velocity.
        backward: bool,
    },
    /// Without a jump.
    Smooth(&'a dyn VelocityFunction),
}

/// A function of a velocity and its slope, per unit of the parameter.
pub trait VelocityFunction: Debug {
    /// Its value at velocity `dq`.
    fn value(&self, dq: f64) -> f64;

    /// Its derivative by the velocity; a sign counts as constant.
    fn slope(&self, dq: f64) -> f64;

    /// Its values in the motion of joint `joint`.
    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]);

    /// Adds `weights · slope` in the motion of joint `joint` to its part of `by_dq`.
    fn add_slopes(&self, joint: usize, motion: &JointMotion<'_>, weights: &[f64], by_dq: &mut [f64]) {
        let range = joint * motion.samples..(joint + 1) * motion.samples;
        for ((to, w), &dq) in by_dq[range].iter_mut().zip(weights).zip(motion.dq_of(joint)) {
            *to += w * self.slope(dq);
        }
    }
}

/// A function of the motion that a friction term adds to a joint's torque. Terms that add the same function to the same
/// joints cannot be distinguished.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionFunction {
    /// The joint.
    pub row: usize,
    /// The function: the same text for the same function.
    pub function: String,
    /// How much of it per unit of the parameter.
    pub factor: f64,
}

/// The property of a joint by which a robot description states a term, by its name in URDF (MJCF).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointProperty {
    /// `damping`.
    Damping,
    /// `friction` (`frictionloss`).
    Friction,
    /// Nothing (`armature`).
    DriveInertia,
    /// Nothing (`stiffness`).
    Stiffness,
}

/// Which step at rest a law has when recordings choose the friction of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRole {
    /// It is Coulomb friction: its step is the joint's.
    Joint,
    /// The joint's, where that is smooth.
    AsJointIfSmooth,
    /// Dry where the joint's is; else a smooth one of this width, rad/s (m/s).
    Own {
        /// The width.
        width: f64,
    },
    /// None, or one that recordings do not choose.
    Fixed,
}

/// A constant of a term, such as a velocity or an exponent, for programs that are not this one.
#[derive(Clone, Debug, PartialEq)]
pub enum TermConstant {
    /// A number, and its unit at a revolute joint as names in files have it (`rad_s`); empty without a unit, or with
    /// the unit in its name.
    Number(f64, &'static str),
    /// One number per joint.
    Numbers([f64; 2]),
    /// One of a few words.
    Word(&'static str),
    /// A step near zero velocity.
    Step(CoulombShape),
    /// A text that the user wrote.
    Text(String),
    /// Points of a curve.
    Points(Vec<[f64; 2]>),
    /// Not there for this term.
    Nothing,
}

/// What a term is called.
pub struct TermLabel<'a> {
    /// Name of the kind.
    pub kind: &'static str,
    /// Symbol of the parameter with the joint's number from 1.
    pub symbol: String,
    /// Unit of the parameter at a revolute joint.
    pub unit: &'a str,
}

/// The properties that every kind of torque term defines.
pub trait TermKind: VelocityFunction {
    /// What it is called.
    fn label(&self) -> TermLabel<'_>;

    /// The joints that feel it.
    fn joints(&self) -> TermJoints;

    /// Whether a negative parameter is unphysical.
    fn is_nonnegative(&self) -> bool {
        true
    }

    /// Where it enters the equation of motion.
    fn action(&self) -> TermAction<'_>;

    /// Its constants by name, beside joints and parameter.
    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        Vec::new()
    }

    /// The regressor column in the row of joint `row`.
    fn column(&self, row: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        self.fill(row, motion, out);
    }

    /// Adds what `Σ weights · column` in the row of joint `row` changes with positions, velocities and accelerations to
    /// the three parts of `gradient`.
    fn apply_adjoint(&self, row: usize, motion: &JointMotion<'_>, weights: &[f64], [_, by_dq, _]: [&mut [f64]; 3]) {
        self.add_slopes(row, motion, weights, by_dq);
    }

    /// The functions of the motion that friction adds. What shares no function with another kind is one of its own.
    fn functions(&self) -> Vec<MotionFunction> {
        let row = match (self.action(), self.joints()) {
            (TermAction::Inertia { .. } | TermAction::Constant, _) => return Vec::new(),
            (_, TermJoints::One(joint) | TermJoints::Two(joint, _)) => joint,
        };
        vec![MotionFunction { row, function: format!("{self:?}"), factor: 1.0 }]
    }

    /// The property of the joint that a robot's description states it by, if any.
    fn property(&self) -> Option<JointProperty> {
        None
    }

    /// The law of a study that states it; `None` for what has other keys.
    fn stated(&self) -> Option<FrictionTerm> {
        None
    }

    /// The step near zero velocity, where it has one.
    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        None
    }

    /// Which step at rest it has when recordings choose a joint's friction.
    fn step_role(&self) -> StepRole {
        StepRole::Fixed
    }

    /// Width of the step at rest where the constant of this name has this value, rad/s (m/s); `None` for a constant
    /// that does not set the width.
    fn step_width_by(&self, constant: &str, value: f64) -> Option<f64> {
        (constant == "width").then_some(value)
    }

    /// The dry friction that it is where a joint rests below the velocity `rest`, and that term's parameter per unit.
    fn dry(&self, _rest: f64) -> Option<(TorqueTerm, f64)> {
        None
    }

    /// The way in one direction after which a law that remembers positions is Coulomb friction, rad (m).
    fn sliding_distance(&self) -> Option<f64> {
        None
    }

    /// For the forward half of friction by direction the other half, and the term that is the same in both.
    fn both_directions(&self) -> Option<[TorqueTerm; 2]> {
        None
    }

    /// The constants that recordings can choose as coordinates: logarithms, or in units of another constant. By default
    /// the width of the joint's step.
    fn coordinates(&self) -> Vec<f64> {
        let is_joints = matches!(self.step_role(), StepRole::Joint | StepRole::AsJointIfSmooth);
        let width = self.constants().into_iter().find_map(|(_, constant)| match constant {
            TermConstant::Step(CoulombShape::Smooth { width }) => Some(width.ln()),
            _ => None,
        });
        width.filter(|_| is_joints).into_iter().collect()
    }

    /// Moves its constants to these coordinates, within bounds; `velocity` is a rad/s (m/s) of a usual arm.
    fn move_to(&mut self, coordinates: &[f64], velocity: f64) {
        let is_joints = matches!(self.step_role(), StepRole::Joint | StepRole::AsJointIfSmooth);
        if let (true, [to, ..], Some(CoulombShape::Smooth { width })) = (is_joints, coordinates, self.step_mut()) {
            *width = velocity_within(*to, velocity);
        }
    }
}

/// Both halves of a function that [`MotionFunction`]s by direction share: for positive and for negative velocity.
pub(super) fn halves(row: usize, function: &str) -> [MotionFunction; 2] {
    ['+', '-'].map(|sign| MotionFunction { row, function: format!("{function} {sign}"), factor: 1.0 })
}
