//! Errors of samples and settings.

use dynident_estimation::EstimationError;
use dynident_identification::consistent::ConsistencyError;
use thiserror::Error;

/// Why a sample or a setting is invalid. An invalid sample changes nothing.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages describe variants and fields")]
pub enum OnlineError {
    #[error("{what}: {found} entries where {expected} are needed")]
    Length { what: &'static str, expected: usize, found: usize },
    #[error("{what} = {value}: {fix}")]
    Number { what: &'static str, value: f64, fix: &'static str },
    #[error("the covariance of the start is not positive definite: give that of an identified model")]
    Covariance,
    #[error(
        "joint {joint}: its friction depends on the temperature, which samples do not contain: identify without the law `temperature`"
    )]
    Temperature { joint: String },
    /// No consistent parameters were found.
    #[error("{0}")]
    Consistency(#[from] ConsistencyError),
    /// Rows that the factor rejects.
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
