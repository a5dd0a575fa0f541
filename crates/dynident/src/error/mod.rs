//! Errors that end a job. Each message contains the file, the place and the fix.

mod code;
mod factors;
mod figure;
mod new_study;
mod place;

pub use code::error_code;
pub use factors::FactorsError;
pub use figure::FigureError;
pub use new_study::{NewStudyError, RecognisedFile};
pub use place::{ErrorPlace, place_in_log, place_in_robot};

use dynident_export::ExportError;
use dynident_identification::IdentificationError;
use dynident_model::ReadError;
use dynident_recording::RecordingError;
use dynident_result::ResultFileError;
pub(crate) use dynident_study::{Expected, StudyError, StudyFileError};
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
    /// A study, or a file that it names, that cannot be used.
    #[error("{0}")]
    Study(#[from] StudyFileError),
    /// A result file that cannot be used.
    #[error("{0}")]
    ResultFile(#[from] ResultFileError),
    /// An identification that failed.
    #[error("{}: {source}", path.display())]
    Identification {
        /// The study file.
        path: PathBuf,
        /// The problem.
        source: Box<IdentificationError>,
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
    /// A report that could not be built.
    #[error("report.html: {0}; this is a bug in Dynident: please report it")]
    Report(#[from] dynident_report::ReportError),
    /// A figure that cannot be written.
    #[error("{0}")]
    Figure(#[from] FigureError),
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
        Self::Study(error.into())
    }
}

impl Error {
    pub(crate) fn recording(log: &str, source: RecordingError) -> Self {
        Self::Study(StudyFileError::recording(log, source))
    }

    /// For `map_err`: wraps an identification error of the study at `path`.
    pub(crate) fn identification<E: Into<IdentificationError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Identification { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: wraps an error in the study at `path`.
    pub(crate) fn study<E: Into<StudyError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Study(StudyFileError::study(path)(source))
    }

    /// For `map_err`: wraps an error in a section of the study at `path`.
    pub(crate) fn section<E: Into<StudyError>>(path: &Path, section: &str) -> impl Fn(E) -> Self {
        move |source| Self::study(path)(StudyError::at(format!("[{section}]"))(source))
    }
}
