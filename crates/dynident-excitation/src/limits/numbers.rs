//! Checks of single numbers.

use super::error::LimitError;

/// Smallest positive limit; the reciprocal of a smaller one could overflow.
const MIN_POSITIVE: f64 = 1e-100;

pub(super) fn finite(what: &str, value: f64) -> Result<(), LimitError> {
    if value.is_finite() { Ok(()) } else { Err(LimitError::NotFinite { what: what.to_owned(), value }) }
}

pub(super) fn positive(what: &str, value: f64) -> Result<(), LimitError> {
    finite(what, value)?;
    if value > MIN_POSITIVE { Ok(()) } else { Err(LimitError::NotPositive { what: what.to_owned(), value }) }
}

pub(super) fn not_negative(what: &str, value: f64) -> Result<(), LimitError> {
    finite(what, value)?;
    if value >= 0.0 {
        return Ok(());
    }
    Err(LimitError::OutOfRange { what: what.to_owned(), value, at_least: 0.0, below: f64::INFINITY })
}
