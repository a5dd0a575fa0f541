//! Errors before a run begins. Events during a run are reported by its [`RunStatus`](crate::RunStatus).

use dynident_excitation::families::FamilyError;
use dynident_model::ModelError;
use thiserror::Error;

/// Reason why an experiment cannot be set up.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// A setting of the simulated robot, its controller or its motion is outside its range. Write a value within the
    /// range that the message names.
    #[error("{what} = {value}: {fix}")]
    Value {
        /// The setting, as in a file.
        what: String,
        /// Value of the setting.
        value: f64,
        /// The fix.
        fix: &'static str,
    },
    /// A list must have one entry for each joint (or parameter). Add or remove entries.
    #[error("{what}: expected {expected} entries, found {found}")]
    Length {
        /// The list.
        what: String,
        /// Expected length.
        expected: usize,
        /// Given length.
        found: usize,
    },
    /// The position loop runs inside the drives of a real robot, so its gains are unknown. Write `kp` and `kd` under
    /// `[controller]` for a simulation.
    #[error("the controller position-loop runs in the robot's drives: state its kp and kd to simulate it")]
    OwnLoop,
    /// This controller computes torques from a model, and no model is available yet. Choose another `kind` under
    /// `[controller]`, or give a model.
    #[error("controller {controller} needs a model of the robot: give one, or use joint-pd or joint-pid")]
    NoModel {
        /// Name of the controller.
        controller: &'static str,
    },
    /// A program added a friction term for a joint number that the robot does not have. Correct the call.
    #[error("term {term} acts on a missing joint; the robot has {joints} joints")]
    TermJoint {
        /// Symbol of the term.
        term: String,
        /// Number of joints of the robot.
        joints: usize,
    },
    /// Negative friction or inertia adds energy, so that the simulated robot would not stay bounded. Write zero or a
    /// positive value.
    #[error("{term} = {value}: a simulated robot needs zero or more")]
    Negative {
        /// Symbol of the term.
        term: String,
        /// Parameter of the term.
        value: f64,
    },
    /// A joint of the simulated robot moves neither a mass nor a drive inertia, so that its acceleration is undefined.
    /// Add the `<inertial>` of its link, or a drive inertia.
    #[error(
        "the simulated robot's mass matrix is not positive definite at the start: give every body at the tip a mass and an inertia, or its drive an inertia"
    )]
    MassMatrix,
    /// The parts of a robot model are inconsistent.
    #[error("{0}")]
    Model(#[from] ModelError),
    /// An invalid trajectory.
    #[error("{0}")]
    Family(#[from] FamilyError),
}

/// Returns [`SimulationError::Value`] unless `holds`.
///
/// # Errors
/// The condition is false.
pub fn require(holds: bool, what: impl Into<String>, value: f64, fix: &'static str) -> Result<(), SimulationError> {
    if holds { Ok(()) } else { Err(SimulationError::Value { what: what.into(), value, fix }) }
}

/// Returns [`SimulationError::Length`] unless the lengths are equal.
///
/// # Errors
/// The lengths differ.
pub fn require_length(what: impl Into<String>, expected: usize, found: usize) -> Result<(), SimulationError> {
    if expected == found { Ok(()) } else { Err(SimulationError::Length { what: what.into(), expected, found }) }
}
