//! The place of an error: file, line and column.

use super::{Error, FigureError};
use dynident_identification::{IdentificationError, LogError};
use dynident_model::ReadError;
use dynident_recording::RecordingError;
use dynident_result::ResultFileError;
use dynident_study::StudyFileError;
use std::path::{Path, PathBuf};

/// The place of an error; parts that are not known are `None`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ErrorPlace {
    /// Path of the file; for a study or samples in memory, their name in messages.
    pub path: Option<PathBuf>,
    /// Line, from 1.
    pub line: Option<u64>,
    /// Column, from 1.
    pub column: Option<u32>,
}

impl ErrorPlace {
    fn file(path: &Path) -> Self {
        Self { path: Some(path.to_owned()), ..Self::default() }
    }

    fn line(path: &Path, line: u64) -> Self {
        Self { line: Some(line), ..Self::file(path) }
    }

    fn column(path: &Path, line: u32, column: u32) -> Self {
        Self { column: Some(column), ..Self::line(path, u64::from(line)) }
    }
}

/// The place of an error of a robot description.
pub fn place_in_robot(error: &ReadError) -> ErrorPlace {
    match error {
        ReadError::File { path, .. } | ReadError::TooLarge { path } | ReadError::Macros { path } => {
            ErrorPlace::file(path)
        }
        ReadError::Empty { path } | ReadError::NoDescription { path, .. } => ErrorPlace::column(path, 1, 1),
        ReadError::Encoding { path, line, column, .. } => ErrorPlace::column(path, *line, *column),
        ReadError::Urdf { path, source } => ErrorPlace::column(path, source.line, source.column),
        ReadError::Mjcf { path, source } => ErrorPlace::column(path, source.line, source.column),
        ReadError::Sdf { path, source } => ErrorPlace::column(path, source.line, source.column),
        ReadError::Dh { path, source } => ErrorPlace::column(path, source.line, source.column),
        // Errors without a place, and errors that are not listed above.
        _ => ErrorPlace::default(),
    }
}

/// The place of an error of a log.
pub fn place_in_log(error: &RecordingError) -> ErrorPlace {
    let (file, line) = error.place();
    ErrorPlace { path: file, line, column: None }
}

fn place_in_study(error: &StudyFileError) -> ErrorPlace {
    match error {
        StudyFileError::StudyAt { path, line, column, .. } => ErrorPlace::column(path, *line, *column),
        StudyFileError::File { path, .. } | StudyFileError::Study { path, .. } | StudyFileError::Xacro { path, .. } => {
            ErrorPlace::file(path)
        }
        StudyFileError::Missing { file, .. } => ErrorPlace::file(file),
        StudyFileError::Robot(error) => place_in_robot(error),
        StudyFileError::Recording { source, .. } => place_in_log(source),
        StudyFileError::Table { path, line, .. } => ErrorPlace::line(path, *line),
        _ => ErrorPlace::default(),
    }
}

impl Error {
    /// The place of the error.
    pub fn place(&self) -> ErrorPlace {
        match self {
            Self::Study(error) | Self::ResultFile(ResultFileError::Study(error)) => place_in_study(error),
            Self::ResultFile(ResultFileError::File { path, .. } | ResultFileError::Content { path, .. }) => {
                ErrorPlace::file(path)
            }
            Self::Identification { path, .. } => self.log_error().map_or_else(|| ErrorPlace::file(path), place_in_log),
            Self::States { path, line, .. } => ErrorPlace::line(path, *line),
            Self::File { path, .. }
            | Self::Changed { path }
            | Self::NotPermitted { path, .. }
            | Self::Result { path, .. }
            | Self::Factors { path, .. }
            | Self::Export { path, .. }
            | Self::Output { path, .. }
            | Self::Figure(FigureError::Ending { path }) => ErrorPlace::file(path),
            Self::Overwrite { output, .. } => ErrorPlace::file(output),
            Self::Figure(FigureError::Report(_))
            | Self::ResultFile(_)
            | Self::Report(_)
            | Self::NewStudy(_)
            | Self::Interrupted { .. } => ErrorPlace::default(),
        }
    }

    /// The error of a log that caused this one, if any.
    pub fn log_error(&self) -> Option<&RecordingError> {
        match self {
            Self::Study(StudyFileError::Recording { source, .. }) => Some(source),
            Self::Identification { source, .. } => match &**source {
                IdentificationError::Log(LogError::Recording { source, .. }) => Some(source),
                _ => None,
            },
            _ => None,
        }
    }
}
