//! Errors of samples and settings.

use dynident_estimation::EstimationError;
use dynident_identification::consistent::ConsistencyError;
use thiserror::Error;

/// Why a sample or a setting is invalid. An invalid sample changes nothing.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "fields are named as in the messages")]
pub enum OnlineError {
    /// A vector of a different length.
    #[error("{what}: {found} entries where {expected} are needed")]
    Length { what: &'static str, expected: usize, found: usize },
    /// An invalid value.
    #[error("{what} = {value}: {fix}")]
    Number { what: &'static str, value: f64, fix: &'static str },
    /// A covariance that is not positive definite.
    #[error("the covariance of the start is not positive definite: give that of an identified model")]
    Covariance,
    /// Temperature-dependent friction.
    #[error("joint {joint}: its friction follows its temperature, which samples do not have: identify without it")]
    Temperature { joint: String },
    /// No consistent parameters were found.
    #[error(transparent)]
    Consistency(#[from] ConsistencyError),
    /// Rows that the factor rejects.
    #[error(transparent)]
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
