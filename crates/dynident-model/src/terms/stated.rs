//! Laws of friction as a study states them.

use super::{CoulombShape, FrictionTerm, TorqueTerm};
use crate::OwnScale;
use core::fmt::Debug;

/// The joint that a law is stated for.
#[derive(Clone, Copy, Debug)]
pub struct StatedJoint {
    /// Its index.
    pub joint: usize,
    /// Its Coulomb step.
    pub step: CoulombShape,
    /// Whether it is revolute.
    pub turns: bool,
    /// The robot's scale.
    pub scale: OwnScale,
}

/// A constant of a stated law that is not possible.
#[derive(Clone, Debug, PartialEq)]
pub enum StatedFault {
    /// A number outside its range.
    Range {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// Least and greatest.
        range: [f64; 2],
    },
    /// A number that is listed twice.
    Twice {
        /// The key of the list.
        key: &'static str,
        /// The number.
        value: f64,
    },
    /// Keys that leave nothing.
    Empty {
        /// What is wrong.
        problem: &'static str,
        /// What to do.
        fix: &'static str,
    },
}

/// Velocities, rad/s or m/s.
pub(super) const VELOCITIES: [f64; 2] = [1.0e-9, 1.0e6];

/// `value`, if it is in `range`; NaN never is.
pub(super) fn check(key: &'static str, value: f64, range: [f64; 2]) -> Result<(), StatedFault> {
    let [least, most] = range;
    if (least..=most).contains(&value) { Ok(()) } else { Err(StatedFault::Range { key, value, range }) }
}

/// A law with the constants that a study states.
pub trait StatedLaw: Debug {
    /// Its terms at a joint.
    fn terms(&self, joint: &StatedJoint) -> Vec<TorqueTerm>;

    /// Checks its constants.
    ///
    /// # Errors
    /// The first that is not possible.
    fn check(&self) -> Result<(), StatedFault> {
        Ok(())
    }

    /// Whether it needs the joint's temperature.
    fn needs_temperature(&self) -> bool {
        false
    }

    /// Adds the constants of `other` where both are one law with a list; false where they are two laws.
    fn join(&mut self, _: &FrictionTerm) -> bool {
        false
    }
}

/// The smooth step of this width, or else the joint's.
pub(super) fn step_or(width: Option<f64>, joint: &StatedJoint) -> CoulombShape {
    width.map_or(joint.step, |width| CoulombShape::Smooth { width })
}

/// The width of a smooth step.
pub(super) fn width_of(step: CoulombShape) -> Option<f64> {
    match step {
        CoulombShape::Sign { .. } => None,
        CoulombShape::Smooth { width } => Some(width),
    }
}
