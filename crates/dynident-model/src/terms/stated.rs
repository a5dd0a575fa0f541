//! Friction laws as a study contains them.

use super::{CoulombShape, FrictionTerm, TorqueTerm};
use crate::CharacteristicScale;
use core::fmt::Debug;

/// The joint to which a study assigns a law.
#[derive(Clone, Copy, Debug)]
pub struct StatedJoint {
    /// Index of the joint.
    pub joint: usize,
    /// The sign function of the joint's Coulomb friction.
    pub step: CoulombShape,
    /// Whether the joint is revolute.
    pub is_rotary: bool,
    /// Characteristic time and length of the robot.
    pub scale: CharacteristicScale,
}

/// An invalid constant of a law in a study.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum StatedFault {
    /// A number outside its range.
    Range { key: &'static str, value: f64, range: [f64; 2] },
    /// A number that is listed twice.
    Twice { key: &'static str, value: f64 },
    /// Keys that disable the whole law.
    Empty { problem: &'static str, fix: &'static str },
}

/// Valid range of velocities, rad/s or m/s.
pub(super) const VALID_VELOCITIES: [f64; 2] = [1.0e-9, 1.0e6];

/// Checks that `value` is in `range` and not NaN.
pub(super) fn check(key: &'static str, value: f64, range: [f64; 2]) -> Result<(), StatedFault> {
    let [least, most] = range;
    if (least..=most).contains(&value) { Ok(()) } else { Err(StatedFault::Range { key, value, range }) }
}

/// A law with the constants given in a study.
pub trait StudyLaw: Debug {
    /// Terms of the law at a joint.
    fn terms(&self, joint: &StatedJoint) -> Vec<TorqueTerm>;

    /// Checks the constants.
    ///
    /// # Errors
    /// The first invalid constant.
    fn check(&self) -> Result<(), StatedFault> {
        Ok(())
    }

    /// Whether the law needs the joint's temperature.
    fn needs_temperature(&self) -> bool {
        false
    }

    /// Appends the constants of `other` if both are the same law with a list; returns false for different laws.
    fn join(&mut self, _: &FrictionTerm) -> bool {
        false
    }
}

/// A smoothed sign function of this width; without a width, the joint's sign function.
pub(super) fn step_or(width: Option<f64>, joint: &StatedJoint) -> CoulombShape {
    width.map_or(joint.step, |width| CoulombShape::Smooth { width })
}

pub(super) fn width_of(step: CoulombShape) -> Option<f64> {
    match step {
        CoulombShape::Sign { .. } => None,
        CoulombShape::Smooth { width } => Some(width),
    }
}
