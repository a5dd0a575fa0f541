//! Everything that can stop a job, each with the file, the place and the fix in its message.

use dynident_estimation::EstimationError;
use dynident_identification::estimators::EstimatorError;
use dynident_identification::{IdentificationError, LogError};
use dynident_model::{ModelError, ReadError};
use dynident_recording::{FilterError, RecordingError};
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
    /// A study that is wrong at a place.
    #[error("{}:{line}:{column}: {message}", path.display())]
    StudyAt {
        /// The study file.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Column, from 1.
        column: u32,
        /// What is wrong, and the fix.
        message: String,
    },
    /// A study that is wrong as a whole.
    #[error("{}: {message}", path.display())]
    Study {
        /// The study file.
        path: PathBuf,
        /// What is wrong, and the fix.
        message: String,
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
    /// A robot that does not fit together.
    #[error("{}: {source}", path.display())]
    Model {
        /// The robot description or study.
        path: PathBuf,
        /// What is wrong.
        source: ModelError,
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
    /// A parallel filter that does not exist at the log's rate.
    #[error("log `{log}`, [parallel_filter]: {source}")]
    Filter {
        /// The log.
        log: String,
        /// What is wrong.
        source: FilterError,
    },
    /// A log without the temperature that friction depends on.
    #[error(
        "log `{log}`: friction of joint `{joint}` depends on the temperature, which the log has not; give its columns as temperature of the format, or leave out the law `temperature`"
    )]
    NoTemperature {
        /// The log.
        log: String,
        /// The first joint that needs it.
        joint: String,
    },
    /// A log that leaves no rows after filtering.
    #[error(
        "log `{log}`: {rows} samples leave nothing behind the parallel filter, which needs {needed}; give a longer part of the log, a higher cut-off, or parallel_filter.enabled = false"
    )]
    NothingLeft {
        /// The log.
        log: String,
        /// Samples of the log.
        rows: u64,
        /// Samples that one filtered row needs.
        needed: usize,
    },
    /// An estimate that cannot be made.
    #[error("{}: {source}", path.display())]
    Estimation {
        /// The study file.
        path: PathBuf,
        /// What is wrong.
        source: EstimationError,
    },
    /// A log or study that lacks what the estimator chosen needs.
    #[error("{}: estimator.method = \"{method}\": {message}", path.display())]
    Method {
        /// The study file.
        path: PathBuf,
        /// The method.
        method: &'static str,
        /// What is wrong, and the fix.
        message: String,
    },
    /// Instruments that do not belong to the log.
    #[error("log `{log}`, instruments: {message}")]
    Instruments {
        /// The log.
        log: String,
        /// What is wrong, and the fix.
        message: String,
    },
    /// A result that does not belong to the study.
    #[error("{}: {message}", path.display())]
    Result {
        /// The result file.
        path: PathBuf,
        /// What is wrong, and the fix.
        message: String,
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

    /// What stops an identification, as an error of the study at `path`.
    pub(crate) fn identification(path: &Path, error: impl Into<IdentificationError>) -> Self {
        let path = path.to_owned();
        match error.into() {
            IdentificationError::Log(LogError::Recording { log, source }) => Self::Recording { log, source },
            IdentificationError::Log(LogError::Filter { log, source }) => Self::Filter { log, source },
            IdentificationError::Log(LogError::NoTemperature { log, joint }) => Self::NoTemperature { log, joint },
            IdentificationError::Log(LogError::NothingLeft { log, rows, needed }) => {
                Self::NothingLeft { log, rows, needed }
            }
            IdentificationError::Log(LogError::Rows { log, source }) => Self::Estimation { path: log.into(), source },
            IdentificationError::Log(LogError::Refused(source)) | IdentificationError::Estimation(source) => {
                Self::Estimation { path, source }
            }
            IdentificationError::Estimator(EstimatorError::Requirement { method, message }) => {
                Self::Method { path, method, message }
            }
            IdentificationError::Estimator(EstimatorError::Instruments { log, message }) => {
                Self::Instruments { log, message }
            }
            other => Self::Study { path, message: other.to_string() },
        }
    }

    pub(crate) fn study(path: &Path, message: String) -> Self {
        Self::Study { path: path.to_owned(), message }
    }
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
