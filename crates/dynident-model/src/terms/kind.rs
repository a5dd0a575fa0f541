//! Interface of the kinds of torque terms. A kind is one type in one file that implements [`TermKind`];
//! [`TorqueTerm`](super::TorqueTerm) delegates to it, so that other code does not depend on the kinds.

use super::candidate::clamped_velocity;
use super::{CoulombShape, FrictionTerm, JointMotion, TermInput, TorqueTerm};
use core::fmt::Debug;

/// Joints on which a term acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TermJoints {
    /// One joint.
    One(usize),
    /// Both joints of a shared drive.
    Two(usize, usize),
}

/// Effect of a term in the equation of motion.
#[derive(Clone, Copy, Debug)]
pub enum TermAction<'a> {
    /// `factor q̈`: a constant entry of the mass matrix, on the diagonal for one joint, off the diagonal for two.
    Inertia {
        /// Entry per unit of the parameter.
        factor: f64,
    },
    /// `factor q̇`, with constant entries on or off the diagonal as for inertia.
    Damping {
        /// Entry per unit of the parameter.
        factor: f64,
    },
    /// A constant torque.
    Constant,
    /// Friction that depends on one velocity.
    Friction(VelocityFriction<'a>),
    /// Friction that depends on the history of positions.
    Hysteresis,
    /// Change of friction with temperature; zero at the reference temperature.
    Temperature,
    /// A torque on one joint that depends on the positions and velocities of any joints.
    State(&'a dyn StateFunction),
}

/// A function of positions and velocities that a user declares.
pub trait StateFunction: Debug {
    /// Value at sample `sample` of a motion; `None` where undefined. Does not allocate, except in the caller's code.
    fn value(&self, motion: &JointMotion<'_>, sample: usize) -> Option<f64>;

    /// Values at all samples of a motion; NaN where undefined.
    fn fill(&self, motion: &JointMotion<'_>, out: &mut [f64]) {
        for (sample, to) in out.iter_mut().enumerate() {
            *to = self.value(motion, sample).unwrap_or(f64::NAN);
        }
    }

    /// Whether the function is defined at sample `sample`: an expression with a value, a position within the range of a
    /// table.
    fn is_inside(&self, motion: &JointMotion<'_>, sample: usize) -> bool;

    /// The first sample of a motion that is not [inside](Self::is_inside).
    fn first_outside(&self, motion: &JointMotion<'_>) -> Option<usize> {
        (0..motion.samples).find(|&sample| !self.is_inside(motion, sample))
    }

    /// Joints on whose motion the function depends, ascending.
    fn follows(&self) -> Vec<usize>;

    /// Short description of the function.
    fn description(&self) -> String;
}

/// Friction that depends on one velocity `w = Σ ratio q̇`; the torque of each joint is `ratio f(w)`.
#[derive(Clone, Copy, Debug)]
pub struct VelocityFriction<'a> {
    /// Velocity ratios of the joints; the second ratio is used for two joints only.
    pub ratios: [f64; 2],
    /// Function of the velocity, before multiplication with the transmitted torque and the Stribeck factor.
    pub curve: VelocityCurve<'a>,
    /// Whether the friction is multiplied by the absolute value of the transmitted torque.
    pub by_load: bool,
    /// Constants `v` and `δ` of the Stribeck factor `e^{-|w/v|^δ}`.
    pub fading: Option<[f64; 2]>,
}

impl<'a> VelocityFriction<'a> {
    pub(super) fn of(curve: VelocityCurve<'a>) -> Self {
        Self { ratios: [1.0, 0.0], curve, by_load: false, fading: None }
    }
}

/// Dependence of friction on velocity.
#[derive(Clone, Copy, Debug)]
pub enum VelocityCurve<'a> {
    /// Sign function; at rest, friction has any value up to one. The fields are the directions in which it acts.
    Step {
        /// Whether it acts at positive velocity.
        forward: bool,
        /// Whether it acts at negative velocity.
        backward: bool,
    },
    /// A continuous function.
    Smooth(&'a dyn VelocityFunction),
}

/// A function of velocity and its slope, per unit of the parameter.
pub trait VelocityFunction: Debug {
    /// Value at velocity `dq`.
    fn value(&self, dq: f64) -> f64;

    /// Derivative with respect to velocity; zero for an unsmoothed sign function.
    fn slope(&self, dq: f64) -> f64;

    /// Values for the motion of joint `joint`.
    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]);

    /// Adds `weights · slope` for the motion of joint `joint` to the joint's part of `by_dq`.
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
    /// Identifier of the function: equal functions have equal texts.
    pub function: String,
    /// Factor per unit of the parameter.
    pub factor: f64,
}

/// Property of a joint in a robot description that corresponds to a term, with its URDF name (and MJCF name if
/// different).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointProperty {
    /// Viscous friction, `damping`.
    Damping,
    /// Coulomb friction, `friction` (`frictionloss`).
    Friction,
    /// Drive inertia, not in URDF (`armature`).
    DriveInertia,
    /// Spring stiffness, not in URDF (`stiffness`).
    Stiffness,
}

/// Relation between the sign function of a law and that of the joint's Coulomb friction, while the friction of a
/// joint is selected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepRole {
    /// The law is Coulomb friction, whose sign function is used for the joint.
    Joint,
    /// The law uses the joint's sign function if that is smoothed.
    AsJointIfSmooth,
    /// The law uses an unsmoothed sign function if the joint does; otherwise a smoothed one of this width, rad/s
    /// (m/s).
    Own {
        /// Width of the smoothed sign function.
        width: f64,
    },
    /// The law has no sign function, or one that is not selected.
    Fixed,
}

/// Value of a constant of a term (such as a velocity or an exponent), for export to other programs.
#[derive(Clone, Debug, PartialEq)]
pub enum TermConstant {
    /// A number with its unit at a revolute joint, as in file keys (`rad_s`). The unit is empty if the number has
    /// none or the name contains it.
    Number(f64, &'static str),
    /// One number per joint.
    Numbers([f64; 2]),
    /// A keyword.
    Word(&'static str),
    /// A smoothed or unsmoothed sign function.
    Step(CoulombShape),
    /// A text of the user.
    Text(String),
    /// Points of a curve.
    Points(Vec<[f64; 2]>),
    /// The constant is not applicable to this term.
    Nothing,
}

/// Kind, symbol and unit of a term.
pub struct TermLabel<'a> {
    /// Name of the kind.
    pub kind: &'static str,
    /// Symbol of the parameter, with the number of the joint counted from 1.
    pub symbol: String,
    /// Unit of the parameter at a revolute joint.
    pub unit: &'a str,
}

/// Interface of a kind of torque term.
pub trait TermKind: VelocityFunction {
    /// Kind, symbol and unit of the term.
    fn label(&self) -> TermLabel<'_>;

    /// Joints on which the term acts.
    fn joints(&self) -> TermJoints;

    /// Whether a negative parameter is physically impossible.
    fn is_nonnegative(&self) -> bool {
        true
    }

    /// Effect of the term in the equation of motion.
    fn action(&self) -> TermAction<'_>;

    /// Constants by name; joints and parameter are not included.
    fn constants(&self) -> Vec<(&'static str, TermConstant)> {
        Vec::new()
    }

    /// Computes the regressor column in the row of joint `row`.
    fn column(&self, row: usize, motion: &JointMotion<'_>, _: &mut TermInput<'_>, out: &mut [f64]) {
        self.fill(row, motion, out);
    }

    /// Adds the derivatives of `Σ weights · column` in the row of joint `row` with respect to positions, velocities and
    /// accelerations to the three parts of `gradient`.
    fn apply_adjoint(&self, row: usize, motion: &JointMotion<'_>, weights: &[f64], [_, by_dq, _]: [&mut [f64]; 3]) {
        self.add_slopes(row, motion, weights, by_dq);
    }

    /// Functions of the motion that the friction adds. A function that no other kind adds is unique to this term.
    fn functions(&self) -> Vec<MotionFunction> {
        let row = match (self.action(), self.joints()) {
            (TermAction::Inertia { .. } | TermAction::Constant, _) => return Vec::new(),
            (_, TermJoints::One(joint) | TermJoints::Two(joint, _)) => joint,
        };
        vec![MotionFunction { row, function: format!("{self:?}"), factor: 1.0 }]
    }

    /// Corresponding property of the joint in a robot description, if any.
    fn property(&self) -> Option<JointProperty> {
        None
    }

    /// Corresponding law of a study; `None` for terms with other keys.
    fn stated(&self) -> Option<FrictionTerm> {
        None
    }

    /// The sign function near zero velocity, if the law has one.
    fn step_mut(&mut self) -> Option<&mut CoulombShape> {
        None
    }

    /// Relation to the joint's sign function during the friction selection.
    fn step_role(&self) -> StepRole {
        StepRole::Fixed
    }

    /// Width of the smoothed sign function that corresponds to this value of the named constant, rad/s (m/s); `None`
    /// for a constant that does not determine the width.
    fn step_width_by(&self, constant: &str, value: f64) -> Option<f64> {
        (constant == "width").then_some(value)
    }

    /// Equivalent dry friction of a joint that is at rest below the velocity `rest`: the term, and its parameter per
    /// unit of this term's parameter.
    fn dry(&self, _rest: f64) -> Option<(TorqueTerm, f64)> {
        None
    }

    /// Distance in one direction after which a law with hysteresis equals Coulomb friction, rad (m).
    fn sliding_distance(&self) -> Option<f64> {
        None
    }

    /// For the forward part of directional friction: the backward part, and the term that has equal parameters in
    /// both directions.
    fn both_directions(&self) -> Option<[TorqueTerm; 2]> {
        None
    }

    /// Constants that can be selected from recordings, as coordinates: logarithms, or multiples of another constant.
    /// Default: the width of the joint's sign function.
    fn coordinates(&self) -> Vec<f64> {
        let is_joints = matches!(self.step_role(), StepRole::Joint | StepRole::AsJointIfSmooth);
        let width = self.constants().into_iter().find_map(|(_, constant)| match constant {
            TermConstant::Step(CoulombShape::Smooth { width }) => Some(width.ln()),
            _ => None,
        });
        width.filter(|_| is_joints).into_iter().collect()
    }

    /// Sets the constants to these coordinates, within bounds; `velocity` corresponds to 1 rad/s (m/s) of a typical
    /// arm.
    fn move_to(&mut self, coordinates: &[f64], velocity: f64) {
        let is_joints = matches!(self.step_role(), StepRole::Joint | StepRole::AsJointIfSmooth);
        if let (true, [to, ..], Some(CoulombShape::Smooth { width })) = (is_joints, coordinates, self.step_mut()) {
            *width = clamped_velocity(*to, velocity);
        }
    }
}

/// Both halves of a function, for positive and for negative velocity; directional laws share these
/// [`MotionFunction`]s.
pub(super) fn halves(row: usize, function: &str) -> [MotionFunction; 2] {
    ['+', '-'].map(|sign| MotionFunction { row, function: format!("{function} {sign}"), factor: 1.0 })
}
