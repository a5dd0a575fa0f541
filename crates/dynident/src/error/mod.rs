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
    /// The file does not exist, or you have no permission to read it. Correct the path or the permissions.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// Another program wrote to the file while Dynident read it, so the stored hash would not match. Wait until the
    /// file is complete, then run the command again.
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
    /// The fit ended with the error that follows the path. That error has its own code; run `dynident docs` with it.
    #[error("{}: {source}", path.display())]
    Identification {
        /// Path of the study file.
        path: PathBuf,
        /// The problem.
        source: Box<IdentificationError>,
    },
    /// The study names a program, for example `iteration.robot.command`. Dynident starts programs only with your
    /// permission. Read the command first.
    #[error(
        "{}: {source}. Read the command, and if you trust it, permit it (--allow-command; in Python allow_command=True)",
        path.display()
    )]
    NotPermitted {
        /// Path of the study file.
        path: PathBuf,
        /// The program that is not permitted.
        source: ProgramRefused,
    },
    /// The numbers of the result cannot be drawn. The study and the logs are not the cause; report the message and the
    /// study.
    #[error("report.html: {0}; this is a bug in Dynident: please report it")]
    Report(#[from] dynident_report::ReportError),
    /// A figure that cannot be written.
    #[error("{0}")]
    Figure(#[from] FigureError),
    /// The result file does not fit the study, the robot or the job: for example, it is of another robot, or it lacks
    /// values that the job needs. The text after the path states what to do, usually to run `identify` again.
    #[error("{}: {message}", path.display())]
    Result {
        /// Path of the result file.
        path: PathBuf,
        /// The problem and the fix.
        message: String,
    },
    /// A factor file, written by `dynident reduce`, cannot be read or merged. The text after the path has the cause
    /// with its own code.
    #[error("{}: {source}", path.display())]
    Factors {
        /// Path of the factor file, or of the study.
        path: PathBuf,
        /// The problem.
        source: FactorsError,
    },
    /// Recordings from which a study cannot be written.
    #[error("{0}")]
    NewStudy(#[source] NewStudyError),
    /// The identified model cannot be written in the form that `dynident export` was given. The text after the path has
    /// the cause with its own code.
    #[error("{}: {source}", path.display())]
    Export {
        /// Path of the result file.
        path: PathBuf,
        /// The problem.
        source: Box<ExportError>,
    },
    /// A table of robot states or a trajectory table has a wrong header, a field that is not a number, or too few rows.
    /// Correct the line that the message names.
    #[error("{}:{line}: {message}", path.display())]
    States {
        /// Path of the table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// The problem and the fix.
        message: String,
    },
    /// The command was stopped, for example by Ctrl-C, before it had a result. Run it again.
    #[error("{what} was interrupted before there was a result: run the command again to restart it")]
    Interrupted {
        /// Name of the interrupted step.
        what: &'static str,
    },
    /// The output folder or file of the command is one of its input files. Give another path with `--out`.
    #[error("{}: would overwrite the input {}; nothing was written: give another --out", output.display(), input.display())]
    Overwrite {
        /// Path of the output.
        output: PathBuf,
        /// Path of the input.
        input: PathBuf,
    },
    /// The folder does not exist, the disk is full, or you have no permission to write. Correct this or give another
    /// `--out`. Existing files are unchanged.
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

    /// For `map_err`: converts an identification error of the study at `path`.
    pub(crate) fn identification<E: Into<IdentificationError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Identification { path: path.to_owned(), source: Box::new(source.into()) }
    }

    /// For `map_err`: converts an error in the study at `path`.
    pub(crate) fn study<E: Into<StudyError>>(path: &Path) -> impl Fn(E) -> Self {
        move |source| Self::Study(StudyFileError::study(path)(source))
    }

    /// For `map_err`: converts an error in a section of the study at `path`.
    pub(crate) fn section<E: Into<StudyError>>(path: &Path, section: &str) -> impl Fn(E) -> Self {
        move |source| Self::study(path)(StudyError::at(format!("[{section}]"))(source))
    }
}
