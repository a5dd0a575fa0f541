//! Errors of the export.

use dynident_dynamics::ParametricModelError;
use dynident_model::ModelError;
use dynident_model::urdf::MAX_MAGNITUDE;
use thiserror::Error;

/// Why a model could not be written.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum ExportError {
    #[error("{found} values for {expected} torque terms: give one for each")]
    Values { expected: usize, found: usize },
    #[error("the model file is damaged: {what}")]
    File { what: String },
    #[error("the value of {symbol} is {value}, not a finite number")]
    NotFinite { symbol: String, value: f64 },
    #[error(
        "body `{body}`: {quantity} is {value:e}; all numbers of a body have to be finite and at most {MAX_MAGNITUDE:e}: identify the model again"
    )]
    Body { body: String, quantity: &'static str, value: f64 },
    #[error(
        "the equations of motion contain the number {value}: a parameter or a constant of a torque term is too large or too small; identify the model again"
    )]
    Overflow { value: f64 },
    #[error("recorded velocities of {found} joints for {expected}: give a list for each, empty if unknown")]
    Velocities { expected: usize, found: usize },
    #[error(
        "joint `{joint}`: {samples} samples of the velocity {velocity}: it has to be finite and not zero, with a positive number of samples"
    )]
    Velocity { joint: String, velocity: f64, samples: f64 },
    #[error("the bodies {} have no inertial: their dynamics are unknown", bodies.join(", "))]
    Unknown { bodies: Vec<String> },
    #[error("the step width {width} is not a positive finite number: state a velocity in rad/s (m/s)")]
    StepWidth { width: f64 },
    #[error("the form {target} has no option {option}: omit the option, or use one of {}", targets.join(", "))]
    Option { option: &'static str, target: &'static str, targets: Vec<&'static str> },
    #[error(
        "{symbol} ({kind}) cannot be written as a function of q, dq and ddq: it needs {needs}; identify with another friction law ([drive] of the study) to export"
    )]
    Term { symbol: String, kind: &'static str, needs: &'static str },
    #[error(
        "joint `{joint}` moves no inertia, so it has no acceleration under a torque: give its body a mass, or lock the joint"
    )]
    NoInertia { joint: String },
    #[error(
        "body `{body}` is not physically consistent (mass or moments not positive, or a moment larger than the sum of the others), so {reader} would refuse it: identify with physical consistency, which is the default"
    )]
    NotPhysical { body: String, reader: &'static str },
    #[error("the model cannot be written as JSON: {message}")]
    Json { message: String },
    /// Terms that do not belong to the model.
    #[error("{0}")]
    Terms(#[from] ParametricModelError),
    /// Numbers that do not form a valid model.
    #[error("{0}")]
    Model(#[from] ModelError),
}
