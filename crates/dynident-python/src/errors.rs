//! Exceptions with the messages of the Rust errors: file, place and fix.

use dynident::{ErrorPlace, place_in_log, place_in_robot};
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    dynident,
    Error,
    PyException,
    "An error, with the file, the place and the fix in its message.\n\n\
     `path`, `line` and `column` are the place of the error, or None. `code` is the name under which `dynident docs` \
     explains the message, or None.\n\n\
     >>> import dynident\n\
     >>> try:\n\
     ...     dynident.Robot.load(\"missing.urdf\")\n\
     ... except dynident.Error as error:\n\
     ...     error.path.name\n\
     'missing.urdf'"
);
create_exception!(
    dynident,
    RobotError,
    Error,
    "A robot description that cannot be read, or an unknown name in it.\n\n\
     >>> import dynident\n\
     >>> dynident.Robot.from_urdf(\"<robot/>\")\n\
     Traceback (most recent call last):\n\
     dynident.RobotError: ..."
);
create_exception!(
    dynident,
    StudyError,
    Error,
    "An invalid study.\n\n\
     >>> import dynident\n\
     >>> dynident.Study.parse(\"[robot]\\nfile = 3\")\n\
     Traceback (most recent call last):\n\
     dynident.StudyError: ..."
);
create_exception!(
    dynident,
    LogError,
    Error,
    "A recording that cannot be read or used.\n\n\
     >>> import dynident\n\
     >>> dynident.Log.from_arrays([0.0], [[1.0]])\n\
     Traceback (most recent call last):\n\
     dynident.LogError: ..."
);
create_exception!(
    dynident,
    ResultError,
    Error,
    "A result that does not belong to its study, or cannot be exported.\n\n\
     >>> import dynident\n\
     >>> dynident.Factors.from_bytes(b\"\")\n\
     Traceback (most recent call last):\n\
     dynident.ResultError: ..."
);

create_exception!(
    dynident,
    StopRun,
    Error,
    "The robot has to be stopped: the run is over. A robot function may raise it if the robot itself has stopped.\n\n\
     >>> import dynident\n\
     >>> raise dynident.StopRun(\"protective stop of joint 3\")\n\
     Traceback (most recent call last):\n\
     dynident.StopRun: protective stop of joint 3"
);

/// The exception of an error of a robot description, with its place.
pub(crate) fn robot(py: Python<'_>, error: &dynident::model::ReadError) -> PyErr {
    placed(py, RobotError::new_err(error.to_string()), place_in_robot(error), None)
}

/// A robot description that is not of the requested format.
pub(crate) fn not_this_format(message: String) -> PyErr {
    RobotError::new_err(message)
}

/// The exception of an error of a log, with its place.
pub(crate) fn log(py: Python<'_>, error: &dynident::recording::RecordingError) -> PyErr {
    placed(py, LogError::new_err(error.to_string()), place_in_log(error), None)
}

pub(crate) fn factors(error: impl core::fmt::Display) -> PyErr {
    ResultError::new_err(error.to_string())
}

/// The exception of a job's error, with its place.
pub(crate) fn job(py: Python<'_>, error: &dynident::Error) -> PyErr {
    use dynident::{Error as Job, ResultFileError as OfResult, StudyFileError as OfStudy};
    let message = dynident::shortened_message(&error.to_string());
    let exception: PyErr = match error {
        _ if error.log_error().is_some() => LogError::new_err(message),
        Job::Study(OfStudy::StudyAt { .. } | OfStudy::Study { .. } | OfStudy::Missing { .. })
        | Job::ResultFile(OfResult::Study(OfStudy::Study { .. }))
        | Job::Identification { .. }
        | Job::NotPermitted { .. } => StudyError::new_err(message),
        Job::Study(OfStudy::Robot(_) | OfStudy::Xacro { .. }) => RobotError::new_err(message),
        Job::Study(OfStudy::Table { .. }) | Job::States { .. } | Job::NewStudy(_) => LogError::new_err(message),
        Job::Result { .. } | Job::ResultFile(OfResult::Content { .. }) | Job::Export { .. } | Job::Factors { .. } => {
            ResultError::new_err(message)
        }
        _ => Error::new_err(message),
    };
    placed(py, exception, error.place(), error.code().as_deref())
}

/// Sets the place and the code of an exception. Names in angle brackets are objects in memory, not files.
fn placed(py: Python<'_>, exception: PyErr, place: ErrorPlace, code: Option<&str>) -> PyErr {
    let value = exception.value(py);
    let path = place.path.filter(|path| !path.to_string_lossy().starts_with('<'));
    // An exception accepts any attribute.
    let _ = value.setattr("path", path);
    let _ = value.setattr("line", place.line);
    let _ = value.setattr("column", place.column);
    let _ = value.setattr("code", code);
    exception
}
