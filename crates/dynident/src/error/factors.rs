//! Errors of factor files.

use dynident_estimation::EstimationError;
use thiserror::Error;

/// Reason why factors cannot be read or merged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FactorsError {
    /// Not a factor file.
    #[error("this is no file of factors: give a file that `reduce` wrote")]
    Kind,
    /// An unsupported version.
    #[error("version {found} of the format; this program reads version {known}: reduce the logs again with it")]
    Version {
        /// Version of the file.
        found: u32,
        /// Version of the program.
        known: u32,
    },
    /// A truncated file.
    #[error("truncated file ({bytes} bytes): copy it again")]
    Short {
        /// Length, bytes.
        bytes: usize,
    },
    /// A corrupt file.
    #[error("corrupt file (hash mismatch): copy it again")]
    Hash,
    /// An unreadable header with a valid hash.
    #[error("unreadable header: {problem}; reduce the logs again")]
    Header {
        /// The problem.
        problem: String,
    },
    /// Invalid numbers in a factor.
    #[error("log {log}: {source}; reduce it again")]
    Numbers {
        /// The log.
        log: String,
        /// The problem.
        source: EstimationError,
    },
    /// An empty list to merge.
    #[error("no factors to merge: give at least one file")]
    Empty,
    /// Factors of different robots or settings.
    #[error("factors of different studies cannot be merged: {} differ; reduce all logs with the same study (and the same --like model)", sections.iter().map(|name| format!("[{name}]")).collect::<Vec<_>>().join(", "))]
    Unlike {
        /// The sections that differ.
        sections: Vec<String>,
    },
    /// A study with code of the caller.
    #[error("{part} is a function of the caller, but factor files cannot contain code: identify from the logs")]
    Function {
        /// The part with the name of its function.
        part: String,
    },
    /// A study that refers to a file.
    #[error("the torque table {file} is a separate file, but factor files cannot contain files: remove this torque")]
    Table {
        /// The file.
        file: String,
    },
}
