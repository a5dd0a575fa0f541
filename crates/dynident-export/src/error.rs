//! Errors of the export.

use dynident_dynamics::ParametricModelError;
use dynident_model::ModelError;
use dynident_model::urdf::MAX_MAGNITUDE;
use thiserror::Error;

/// Why a model could not be written.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "fields are named as in the messages")]
pub enum ExportError {
    /// The number of values differs from the number of terms.
    #[error("{found} values for {expected} torque terms: give one for each")]
    Values { expected: usize, found: usize },
    /// A value that is not finite.
    #[error("the value of {symbol} is {value}, not a finite number")]
    NotFinite {
        /// The term's symbol.
        symbol: String,
        value: f64,
    },
    /// A body with a number that simulators reject, or that leads to such a number.
    #[error(
        "body `{body}`: {quantity} is {value:e}; all numbers of a body have to be finite and at most {MAX_MAGNITUDE:e}: identify the model again"
    )]
    Body { body: String, quantity: &'static str, value: f64 },
    /// The equations of motion overflow.
    #[error(
        "the equations of motion contain the number {value}: a parameter or a constant of a torque term is too large or too small; identify the model again"
    )]
    Overflow { value: f64 },
    /// Recorded velocities for a different number of joints.
    #[error("recorded velocities of {found} joints for {expected}: give a list for each, empty if unknown")]
    Velocities { expected: usize, found: usize },
    /// An invalid recorded velocity.
    #[error(
        "joint `{joint}`: {samples} samples of the velocity {velocity}: it has to be finite and not zero, with a positive number of samples"
    )]
    Velocity { joint: String, velocity: f64, samples: f64 },
    /// Bodies without inertials.
    #[error("the bodies {} have no inertial: their dynamics are unknown", bodies.join(", "))]
    Unknown { bodies: Vec<String> },
    /// A torque term that is not a function of the current motion.
    #[error(
        "{symbol} ({kind}) cannot be written as a function of q, dq and ddq: it needs {needs}; identify with another friction law ([drive] of the study) to export"
    )]
    Term {
        /// The term's symbol.
        symbol: String,
        kind: &'static str,
        needs: &'static str,
    },
    /// A joint that moves no inertia.
    #[error(
        "joint `{joint}` moves no inertia, so it has no acceleration under a torque: give its body a mass, or lock it"
    )]
    NoInertia { joint: String },
    /// A body that a simulator rejects.
    #[error(
        "body `{body}` is not physically consistent (mass or moments not positive, or a moment larger than the sum of the others), so {reader} would refuse it: identify with physical consistency, which is the default"
    )]
    NotPhysical { body: String, reader: &'static str },
    /// A value that JSON cannot represent.
    #[error("the model cannot be written as JSON: {message}")]
    Json { message: String },
    /// Terms that do not belong to the model.
    #[error(transparent)]
    Terms(#[from] ParametricModelError),
    /// Numbers that do not form a valid model.
    #[error(transparent)]
    Model(#[from] ModelError),
}
