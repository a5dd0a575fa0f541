//! Errors of a study and of the files that it names. Each message contains the file, the place and the fix.

mod section;
mod xacro;

pub use section::{Expected, StudyError};
pub use xacro::XacroError;

use dynident_model::ReadError;
use dynident_recording::RecordingError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Reason why a study, or a file that it names, cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyFileError {
    /// A file that cannot be read.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// An error at a place in the text of a study.
    #[error("{}:{line}:{column}: {source}", path.display())]
    StudyAt {
        /// The study file.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// The problem.
        source: Box<StudyError>,
    },
    /// An error of the whole study, or a mismatch with its robot.
    #[error("{}: {source}", path.display())]
    Study {
        /// The study file.
        path: PathBuf,
        /// The problem.
        source: Box<StudyError>,
    },
    /// A file that is in none of the study's folders.
    #[error("{} is in none of the study's folders (tried {}); correct its path in the study, or name its folder there with `data` (or with --data of the command){}",
        file.display(), list(tried), source_of_data.as_ref().map_or(String::new(), |s| format!(". The recordings are public: {s}")))]
    Missing {
        /// The file.
        file: PathBuf,
        /// The paths tried.
        tried: Vec<PathBuf>,
        /// Source of the recordings.
        source_of_data: Option<String>,
    },
    /// A robot description that cannot be read.
    #[error("{0}")]
    Robot(#[source] Box<ReadError>),
    /// A robot file whose macros cannot be expanded.
    #[error("{}: {source}", path.display())]
    Xacro {
        /// The robot file.
        path: PathBuf,
        /// The problem.
        source: Box<XacroError>,
    },
    /// A log that cannot be read.
    #[error("log `{log}`: {source}")]
    Recording {
        /// The log.
        log: String,
        /// The problem.
        source: Box<RecordingError>,
    },
    /// An invalid table of torque.
    #[error("{}:{line}: {message}", path.display())]
    Table {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The problem and the fix.
        message: String,
    },
}

impl From<ReadError> for StudyFileError {
    fn from(error: ReadError) -> Self {
        Self::Robot(Box::new(error))
    }
}

impl StudyFileError {
    /// An error of the log with this name.
    pub fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }

    /// For `map_err`: wraps an error in the study at `path`.
    pub fn study<E: Into<StudyError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Study { path: path.to_owned(), source: Box::new(source.into()) }
    }
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
