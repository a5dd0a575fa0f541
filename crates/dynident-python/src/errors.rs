//! Exceptions: what the Rust side says, with file, place and what to do in the message.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(dynident, Error, PyException, "What went wrong, with the file, the place and what to do.");
create_exception!(
    dynident,
    RobotError,
    Error,
    "A robot's description that cannot be read, or a name it does not have."
);
create_exception!(dynident, StudyError, Error, "A study that cannot be done as it is written.");
create_exception!(dynident, LogError, Error, "A recording that cannot be read.");

/// The exception of a description or of what is asked of it.
pub(crate) fn robot(error: impl core::fmt::Display) -> PyErr {
    RobotError::new_err(error.to_string())
}
