//! What can be wrong with samples and settings.

use dynident_estimation::EstimationError;
use dynident_identification::consistent::ConsistencyError;
use thiserror::Error;

/// Why a sample or a setting cannot be used. A refused sample changes nothing.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OnlineError {
    /// A vector of another length.
    #[error("{what}: {found} entries where {expected} are needed")]
    Length {
        /// Which vector.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A number that cannot be used.
    #[error("{what} = {value}: {fix}")]
    Number {
        /// Which number.
        what: &'static str,
        /// The number.
        value: f64,
        /// What to give.
        fix: &'static str,
    },
    /// A covariance that is none.
    #[error("the covariance of the start is not positive definite: give that of an identified model")]
    Covariance,
    /// Friction that follows a temperature.
    #[error("joint {joint}: its friction follows its temperature, which samples do not have: identify without it")]
    Temperature {
        /// The joint.
        joint: String,
    },
    /// No consistent parameters.
    #[error(transparent)]
    Consistency(#[from] ConsistencyError),
    /// Rows that a factor refuses.
    #[error(transparent)]
    Rows(#[from] EstimationError),
}

/// That a vector has one finite number for each entry.
pub(crate) fn check(what: &'static str, values: &[f64], expected: usize) -> Result<(), OnlineError> {
    if values.len() != expected {
        return Err(OnlineError::Length { what, expected, found: values.len() });
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(OnlineError::Number { what, value, fix: "give a finite number" }),
        None => Ok(()),
    }
}

/// That all numbers are positive and finite.
pub(crate) fn check_positive(what: &'static str, values: &[f64]) -> Result<(), OnlineError> {
    match values.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
        Some(&value) => Err(OnlineError::Number { what, value, fix: "give a positive number" }),
        None => Ok(()),
    }
}
