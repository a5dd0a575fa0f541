//! Everything that can stop a job, each with the file, the place and the fix in its message.

mod factors;
mod new_study;
mod study;
mod xacro;

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

/// Why a job could not be done. All of these are bad usage or bad input: the command exits with status 2.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file that is not the one that was first read: what is known of it does not belong to its hash.
    #[error("{}: the file changed while it was read; wait until nothing writes to it, then run the command again", path.display())]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A study that is wrong at a place of its text.
    #[error("{}:{line}:{column}: {source}", path.display())]
    StudyAt {
        /// The study file.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What is wrong.
        source: StudyError,
    },
    /// A study that is wrong as a whole, or does not go with its robot.
    #[error("{}: {source}", path.display())]
    Study {
        /// The study file.
        path: PathBuf,
        /// What is wrong.
        source: Box<StudyError>,
    },
    /// A study whose model cannot be identified from its logs.
    #[error("{}: {source}", path.display())]
    Identification {
        /// The study file.
        path: PathBuf,
        /// What is wrong.
        source: Box<IdentificationError>,
    },
    /// A file of the study that is in none of its folders.
    #[error("{} is in none of the study's folders (tried {}); fix its path, or name its folder with --data{}",
        file.display(), list(tried), source_of_data.as_ref().map_or(String::new(), |s| format!(". The recordings are public: {s}")))]
    Missing {
        /// The file.
        file: PathBuf,
        /// Where it was looked for.
        tried: Vec<PathBuf>,
        /// Where it can be had.
        source_of_data: Option<String>,
    },
    /// A robot description that cannot be read.
    #[error(transparent)]
    Robot(Box<ReadError>),
    /// A robot file whose macros cannot be expanded.
    #[error("{}: {source}", path.display())]
    Xacro {
        /// The robot file.
        path: PathBuf,
        /// What is wrong.
        source: Box<XacroError>,
    },
    /// A study's program that was not permitted.
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
        /// What is wrong.
        source: Box<RecordingError>,
    },
    /// A report that could not be put together.
    #[error("report.html: {0}; this is a defect of the program: please report it")]
    Report(#[from] dynident_report::ReportError),
    /// A result that does not belong to the study.
    #[error("{}: {message}", path.display())]
    Result {
        /// The result file.
        path: PathBuf,
        /// What is wrong, and the fix.
        message: String,
    },
    /// Factors of logs that cannot be read or put together.
    #[error("{}: {source}", path.display())]
    Factors {
        /// The file, or the study.
        path: PathBuf,
        /// What is wrong.
        source: FactorsError,
    },
    /// Recordings from which no study can be written.
    #[error(transparent)]
    NewStudy(NewStudyError),
    /// A model that a form cannot hold.
    #[error("{}: {source}", path.display())]
    Export {
        /// The result file.
        path: PathBuf,
        /// What cannot be written.
        source: Box<ExportError>,
    },
    /// A table of states that cannot be used.
    #[error("{}:{line}: {message}", path.display())]
    States {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What is wrong, and the fix.
        message: String,
    },
    /// Somebody asked for a stop before there was anything to keep.
    #[error("{what} was interrupted, and nothing was kept of it: the same command begins it anew")]
    Interrupted {
        /// What.
        what: &'static str,
    },
    /// An output that would take the place of an input.
    #[error("{}: would overwrite {}, which this command reads; nothing was written: give another --out", output.display(), input.display())]
    Overwrite {
        /// What would be written.
        output: PathBuf,
        /// What is read.
        input: PathBuf,
    },
    /// An output that cannot be written. What was there before is untouched.
    #[error("{}: cannot be written: {source}; nothing that was there has changed", path.display())]
    Output {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

impl From<ReadError> for Error {
    fn from(error: ReadError) -> Self {
        Self::Robot(Box::new(error))
    }
}

impl Error {
    /// A log that cannot be read.
    pub(crate) fn recording(log: &str, source: RecordingError) -> Self {
        Self::Recording { log: log.to_owned(), source: Box::new(source) }
    }

    /// For `map_err`: what stops an identification of the study at `path`.
    pub(crate) fn identification<E: Into<IdentificationError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Identification { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: what is wrong in the study at `path`.
    pub(crate) fn study<E: Into<StudyError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Study { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: what is wrong in a section of the study at `path`.
    pub(crate) fn section<E: Into<StudyError>>(path: &Path, section: &str) -> impl Fn(E) -> Self {
        move |source| Self::study(path)(StudyError::at(format!("[{section}]"))(source))
    }
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
