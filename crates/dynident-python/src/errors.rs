//! Exceptions with the messages of the Rust errors: file, place and fix.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::path::Path;

create_exception!(
    dynident,
    Error,
    PyException,
    "An error, with the file, the place and the fix in its message.\n\n`path`, `line` and `column` are the place of the error, or None. `code` is the name under which `dynident docs` explains the message, or None."
);
create_exception!(dynident, RobotError, Error, "A robot description that cannot be read, or an unknown name in it.");
create_exception!(dynident, StudyError, Error, "An invalid study.");
create_exception!(dynident, LogError, Error, "A recording that cannot be read or used.");
create_exception!(dynident, ResultError, Error, "A result that does not belong to its study, or cannot be exported.");

create_exception!(dynident, StopRun, Error, "The robot has to be stopped: the run is over.");

pub(crate) fn robot(error: impl core::fmt::Display) -> PyErr {
    RobotError::new_err(error.to_string())
}

pub(crate) fn log(error: impl core::fmt::Display) -> PyErr {
    LogError::new_err(error.to_string())
}

pub(crate) fn factors(error: impl core::fmt::Display) -> PyErr {
    ResultError::new_err(error.to_string())
}

/// The exception of a job's error, with its place.
pub(crate) fn job(py: Python<'_>, error: &dynident::Error) -> PyErr {
    use dynident::{Error as Job, ResultFileError as OfResult, StudyFileError as OfStudy};
    let message = dynident::shortened_message(&error.to_string());
    let (exception, path, line, column): (PyErr, Option<&Path>, Option<u64>, Option<u32>) = match error {
        Job::Study(OfStudy::StudyAt { path, line, column, .. }) => {
            (StudyError::new_err(message), Some(path), Some(u64::from(*line)), Some(*column))
        }
        Job::Study(OfStudy::Study { path, .. })
        | Job::ResultFile(OfResult::Study(OfStudy::Study { path, .. }))
        | Job::Identification { path, .. }
        | Job::NotPermitted { path, .. } => (StudyError::new_err(message), Some(path), None, None),
        Job::Study(OfStudy::Robot(_)) => (RobotError::new_err(message), None, None, None),
        Job::Study(OfStudy::Xacro { path, .. }) => (RobotError::new_err(message), Some(path), None, None),
        Job::Study(OfStudy::Recording { .. }) | Job::NewStudy(_) => (LogError::new_err(message), None, None, None),
        Job::States { path, line, .. } | Job::Study(OfStudy::Table { path, line, .. }) => {
            (LogError::new_err(message), Some(path), Some(*line), None)
        }
        Job::Study(OfStudy::Missing { file, .. }) => (StudyError::new_err(message), Some(file), None, None),
        Job::Result { path, .. }
        | Job::ResultFile(OfResult::Content { path, .. })
        | Job::Export { path, .. }
        | Job::Factors { path, .. } => (ResultError::new_err(message), Some(path), None, None),
        Job::File { path, .. }
        | Job::Study(OfStudy::File { path, .. })
        | Job::ResultFile(OfResult::File { path, .. })
        | Job::Output { path, .. }
        | Job::Changed { path } => (Error::new_err(message), Some(path), None, None),
        _ => (Error::new_err(message), None, None, None),
    };
    let value = exception.value(py);
    // An exception accepts any attribute.
    let _ = value.setattr("path", path);
    let _ = value.setattr("line", line);
    let _ = value.setattr("column", column);
    let _ = value.setattr("code", error.code());
    exception
}
