//! Errors of the export.

use dynident_dynamics::ParametricModelError;
use dynident_model::ModelError;
use dynident_model::urdf::MAX_MAGNITUDE;
use thiserror::Error;

/// Why a model could not be written.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum ExportError {
    /// A program passed the wrong number of coefficients for friction and other torque terms. Correct the call.
    #[error("{found} values for {expected} torque terms: give one for each")]
    Values { expected: usize, found: usize },
    /// The model file was changed by hand or truncated. Run `identify` again.
    #[error("the model file is damaged: {what}")]
    File { what: String },
    /// The coefficient of this torque term is NaN or infinite. Run `identify` again, and see the problems that it
    /// reports.
    #[error("the value of {symbol} is {value}, not a finite number")]
    NotFinite { symbol: String, value: f64 },
    /// A mass, centre of mass or inertia of this body is NaN, infinite or too large for any robot. Run `identify`
    /// again, and see the problems that it reports.
    #[error(
        "body `{body}`: {quantity} is {value:e}; all numbers of a body have to be finite and at most {MAX_MAGNITUDE:e}: identify the model again"
    )]
    Body { body: String, quantity: &'static str, value: f64 },
    /// A product of parameters is too large or too small for the generated code. Usually a unit or scale in the study
    /// is wrong.
    #[error(
        "the equations of motion contain the number {value}: a parameter or a constant of a torque term is too large or too small; identify the model again"
    )]
    Overflow { value: f64 },
    /// A program passed the recorded velocities for the wrong number of joints. Correct the call.
    #[error("recorded velocities of {found} joints for {expected}: give a list for each, empty if unknown")]
    Velocities { expected: usize, found: usize },
    /// A program passed a recorded velocity that is zero or not finite, or without samples. Correct the call.
    #[error(
        "joint `{joint}`: {samples} samples of the velocity {velocity}: it has to be finite and not zero, with a positive number of samples"
    )]
    Velocity { joint: String, velocity: f64, samples: f64 },
    /// The form needs mass and inertia of every body, and the robot description has none for these. Add their
    /// `<inertial>`, and run `identify` again.
    #[error("the bodies {} have no inertial: their dynamics are unknown", bodies.join(", "))]
    Unknown { bodies: Vec<String> },
    /// The width is the velocity within which a smooth step replaces the sign of Coulomb friction. It must be larger
    /// than zero.
    #[error("the step width {width} is not a positive finite number: state a velocity in rad/s (m/s)")]
    StepWidth { width: f64 },
    /// This option exists only for other forms of export. Remove it, or choose another form.
    #[error("the form {target} has no option {option}: omit the option, or use one of {}", targets.join(", "))]
    Option { option: &'static str, target: &'static str, targets: Vec<&'static str> },
    /// This law has a memory or needs a signal, such as temperature, that a controller does not pass. Identify with
    /// another law under `[drive]`.
    #[error(
        "{symbol} ({kind}) cannot be written as a function of q, dq and ddq: it needs {needs}; identify with another friction law ([drive] of the study) to export"
    )]
    Term { symbol: String, kind: &'static str, needs: &'static str },
    /// The bodies behind this joint have no mass, so that a simulator would divide by zero. Lock the joint, or add a
    /// mass.
    #[error(
        "joint `{joint}` moves no inertia, so it has no acceleration under a torque: give its body a mass, or lock the joint"
    )]
    NoInertia { joint: String },
    /// The parameters are those of an unconstrained estimate, or the robot description has impossible values. Identify
    /// without `physical = false`.
    #[error(
        "body `{body}` is not physically consistent (mass or moments not positive, or a moment larger than the sum of the others), so {reader} would refuse it: identify with physical consistency, which is the default"
    )]
    NotPhysical { body: String, reader: &'static str },
    /// A bug in Dynident. Report the message with the model file.
    #[error("the model cannot be written as JSON: {message}")]
    Json { message: String },
    /// Terms that do not belong to the model.
    #[error("{0}")]
    Terms(#[from] ParametricModelError),
    /// Numbers that do not form a valid model.
    #[error("{0}")]
    Model(#[from] ModelError),
}
