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
    /// The study, a file that it names, or the folder of `--data` does not exist, or you have no permission to read it.
    /// Correct the path or the permissions.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// The study has an error at this line and column. The text after the place has the cause and the fix.
    #[error("{}:{line}:{column}: {source}", path.display())]
    StudyAt {
        /// The study file.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Column, in characters from 1.
        column: u32,
        /// The problem.
        source: Box<StudyError>,
    },
    /// The study as a whole has an error, or it does not match its robot. The text after the path names the key and the
    /// fix.
    #[error("{}: {source}", path.display())]
    Study {
        /// The study file.
        path: PathBuf,
        /// The problem.
        source: Box<StudyError>,
    },
    /// The study names a file that does not exist in the folder of the study or in the folder `data`. Correct the path,
    /// or name the folder with `data` or `--data`.
    #[error("{} is in none of the study's folders (tried {}); correct its path in the study, or name its folder there with `data` (or with --data of the command){}",
        file.display(), list(tried), source_of_data.as_ref().map_or(String::new(), |s| format!(". The recordings are public: {s}")))]
    Missing {
        /// The file.
        file: PathBuf,
        /// The paths that were searched.
        tried: Vec<PathBuf>,
        /// Source of the recordings, if known.
        source_of_data: Option<String>,
    },
    /// A robot description that cannot be read.
    #[error("{0}")]
    Robot(#[source] Box<ReadError>),
    /// The robot file contains xacro macros, and the program `xacro` could not expand them. The text after the path has
    /// the cause.
    #[error("{}: {source}", path.display())]
    Xacro {
        /// The robot file.
        path: PathBuf,
        /// The problem.
        source: Box<XacroError>,
    },
    /// The file of this `[[log]]` cannot be read, or its rows do not fit `[format]`. The text after the name has the
    /// cause and the fix.
    #[error("log `{log}`: {source}")]
    Recording {
        /// Name of the log.
        log: String,
        /// The problem.
        source: Box<RecordingError>,
    },
    /// The `table_file` of a `[[torque]]` has a line that is not two numbers, position and torque, or invalid points.
    /// Correct the printed line.
    #[error("{}:{line}: {message}", path.display())]
    Table {
        /// Path of the table.
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
