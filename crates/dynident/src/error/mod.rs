//! Errors that end a job. Each message contains the file, the place and the fix.

mod code;
mod factors;
mod new_study;
mod study;
mod xacro;

pub use code::error_code;
pub use factors::FactorsError;
pub use new_study::NewStudyError;
pub use study::{Expected, StudyError};
pub use xacro::XacroError;

use dynident_export::ExportError;
use dynident_identification::IdentificationError;
use dynident_model::ReadError;
use dynident_recording::RecordingError;
use dynident_system::ProgramRefused;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Reason why a job failed. All are usage or input errors; the command exits with status 2.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// An input file that changed while it was read, so that its hash is not valid.
    #[error("{}: the file changed while it was read; run the command again when no program writes to it", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
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
        source: StudyError,
    },
    /// An error of the whole study, or a mismatch with its robot.
    #[error("{}: {source}", path.display())]
    Study {
        /// The study file.
        path: PathBuf,
        /// The problem.
        source: Box<StudyError>,
    },
    /// An identification that failed.
    #[error("{}: {source}", path.display())]
    Identification {
        /// The study file.
        path: PathBuf,
        /// The problem.
        source: Box<IdentificationError>,
    },
    /// A file that is in none of the study's folders.
    #[error("{} is in none of the study's folders (tried {}); fix its path, or name its folder with --data{}",
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
    /// A program in the study that was not permitted.
    #[error(
        "{}: {source}. Read the command, and if you trust it, permit it (--allow-command; in Python allow_command=True)",
        path.display()
    )]
    NotPermitted {
        /// The study file.
        path: PathBuf,
        /// The program.
        source: ProgramRefused,
    },
    /// A log that cannot be read.
    #[error("log `{log}`: {source}")]
    Recording {
        /// The log.
        log: String,
        /// The problem.
        source: Box<RecordingError>,
    },
    /// A report that could not be built.
    #[error("report.html: {0}; this is a bug in Dynident: please report it")]
    Report(#[from] dynident_report::ReportError),
    /// A result that does not belong to the study.
    #[error("{}: {message}", path.display())]
    Result {
        /// The result file.
        path: PathBuf,
        /// The problem and the fix.
        message: String,
    },
    /// Factors that cannot be read or merged.
    #[error("{}: {source}", path.display())]
    Factors {
        /// The file, or the study.
        path: PathBuf,
        /// The problem.
        source: FactorsError,
    },
    /// Recordings from which a study cannot be written.
    #[error("{0}")]
    NewStudy(#[source] NewStudyError),
    /// A model that the export target cannot represent.
    #[error("{}: {source}", path.display())]
    Export {
        /// The result file.
        path: PathBuf,
        /// The problem.
        source: Box<ExportError>,
    },
    /// An invalid table of states.
    #[error("{}:{line}: {message}", path.display())]
    States {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The problem and the fix.
        message: String,
    },
    /// A stop request before there was a result.
    #[error("{what} was interrupted before there was a result: run the command again to restart it")]
    Interrupted {
        /// The interrupted step.
        what: &'static str,
    },
    /// An output that would overwrite an input.
    #[error("{}: would overwrite the input {}; nothing was written: give another --out", output.display(), input.display())]
    Overwrite {
        /// The output.
        output: PathBuf,
        /// The input.
        input: PathBuf,
    },
    /// An output that cannot be written. Existing files are unchanged.
    #[error("{}: cannot be written: {source}; existing files are unchanged", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
}

impl From<ReadError> for Error {
    fn from(error: ReadError) -> Self {
        Self::Robot(Box::new(error))
    }
}

impl Error {
    pub(crate) fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }

    /// For `map_err`: wraps an identification error of the study at `path`.
    pub(crate) fn identification<E: Into<IdentificationError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Identification { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: wraps an error in the study at `path`.
    pub(crate) fn study<E: Into<StudyError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Study { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: wraps an error in a section of the study at `path`.
    pub(crate) fn section<E: Into<StudyError>>(path: &Path, section: &str) -> impl Fn(E) -> Self {
        move |source| Self::study(path)(StudyError::at(format!("[{section}]"))(source))
    }
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
