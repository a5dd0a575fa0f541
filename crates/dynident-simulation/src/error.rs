//! What can be wrong before a run begins. What happens during a run is its verdict, not an error: see
//! [`RunStatus`](crate::RunStatus).

use dynident_excitation::families::FamilyError;
use dynident_model::ModelError;
use thiserror::Error;

/// Why an experiment could not be set up.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// A number outside of its range.
    #[error("{what} = {value}: {fix}")]
    Value {
        /// The setting, as in a file.
        what: String,
        /// The value given.
        value: f64,
        /// What to do.
        fix: &'static str,
    },
    /// A list that has not one entry for each joint (or parameter).
    #[error("{what}: {found} entries where {expected} are needed")]
    Length {
        /// What it is a list of.
        what: String,
        /// How many there must be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A robot's own loop of which nothing is known here.
    #[error("the controller position-loop runs in the robot's drives: state its kp and kd to simulate it")]
    OwnLoop,
    /// A controller that needs a model and was given none.
    #[error("controller {controller} needs a model of the robot: give one, or take joint-pd or joint-pid")]
    NoModel {
        /// The controller.
        controller: &'static str,
    },
    /// A term that acts on a joint which does not exist.
    #[error("term {term} acts on a joint that the robot of {joints} joints does not have")]
    TermJoint {
        /// The term's symbol.
        term: String,
        /// How many joints there are.
        joints: usize,
    },
    /// Friction or inertia that would create energy.
    #[error("{term} = {value}: a simulated robot needs zero or more")]
    Negative {
        /// The term's symbol.
        term: String,
        /// Its parameter.
        value: f64,
    },
    /// One of many loops that could not be set up.
    #[error("loop {index}: {source}")]
    Loop {
        /// Its place, from zero.
        index: usize,
        /// What is wrong with it.
        source: Box<SimulationError>,
    },
    /// The mass matrix has no inverse: some joint moves nothing.
    #[error(
        "the simulated robot's mass matrix is not positive definite at the start: give every body at the tip a mass and an inertia, or its drive an inertia"
    )]
    MassMatrix,
    /// A model's parts do not fit.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A trajectory without meaning.
    #[error(transparent)]
    Family(#[from] FamilyError),
}

/// `Ok` if `holds`, else [`SimulationError::Value`].
///
/// # Errors
/// As said.
pub fn require(holds: bool, what: impl Into<String>, value: f64, fix: &'static str) -> Result<(), SimulationError> {
    if holds { Ok(()) } else { Err(SimulationError::Value { what: what.into(), value, fix }) }
}

/// `Ok` if the numbers are equal, else [`SimulationError::Length`].
///
/// # Errors
/// As said.
pub fn require_length(what: impl Into<String>, expected: usize, found: usize) -> Result<(), SimulationError> {
    if expected == found { Ok(()) } else { Err(SimulationError::Length { what: what.into(), expected, found }) }
}
