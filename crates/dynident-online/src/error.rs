//! Errors of samples and settings.

use dynident_estimation::EstimationError;
use dynident_identification::consistent::ConsistencyError;
use thiserror::Error;

/// Reason why a sample or a setting is invalid. An invalid sample does not change the state of the monitor.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe the fields")]
pub enum OnlineError {
    /// A program passed a list of the wrong length to the monitor. Pass one entry for each joint or parameter.
    #[error("{what}: {found} entries where {expected} are needed")]
    Length { what: &'static str, expected: usize, found: usize },
    /// A setting or a sample of the monitor is outside its range or not finite. Write a value as the message states.
    #[error("{what} = {value}: {fix}")]
    Number { what: &'static str, value: f64, fix: &'static str },
    /// The error bars of the start model are not valid. Start from the result of `identify`, unchanged.
    #[error("the covariance of the start is not positive definite: give that of an identified model")]
    Covariance,
    /// The model was identified with the friction law `temperature`, but the monitor gets no temperatures.
    #[error(
        "joint {joint}: its friction depends on the temperature, which samples do not contain: identify without the law `temperature`"
    )]
    Temperature { joint: String },
    /// No consistent parameters were found.
    #[error("{0}")]
    Consistency(#[from] ConsistencyError),
    /// The triangular factor rejects the rows of a sample.
    #[error("{0}")]
    Rows(#[from] EstimationError),
}

/// Checks the length of a vector, and that its values are finite.
pub(crate) fn check(what: &'static str, values: &[f64], expected: usize) -> Result<(), OnlineError> {
    if values.len() != expected {
        return Err(OnlineError::Length { what, expected, found: values.len() });
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(OnlineError::Number { what, value, fix: "give a finite number" }),
        None => Ok(()),
    }
}

pub(crate) fn check_positive(what: &'static str, values: &[f64]) -> Result<(), OnlineError> {
    match values.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
        Some(&value) => Err(OnlineError::Number { what, value, fix: "give a positive number" }),
        None => Ok(()),
    }
}
