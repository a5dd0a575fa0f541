//! What can be wrong with factors.

use dynident_estimation::EstimationError;
use thiserror::Error;

/// Why factors cannot be read or put together.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FactorsError {
    /// Not such a file.
    #[error("this is no file of factors: give one that `reduce` wrote")]
    Kind,
    /// A version that this program does not read.
    #[error("version {found} of the format; this program reads version {known}: reduce the logs again with it")]
    Version {
        /// The file's.
        found: u32,
        /// The program's.
        known: u32,
    },
    /// A part of a file.
    #[error("the file ends at byte {bytes}, before its end: copy it again")]
    Short {
        /// Its length.
        bytes: usize,
    },
    /// A file that is not as it was written.
    #[error("the contents do not have the hash that they were written with: copy the file again")]
    Hash,
    /// A head that cannot be read, although its hash is right.
    #[error("the head cannot be read: {problem}; reduce the logs again")]
    Header {
        /// What is wrong.
        problem: String,
    },
    /// Numbers that are no factor's.
    #[error("log {log}: {source}; reduce it again")]
    Numbers {
        /// The log.
        log: String,
        /// What is wrong.
        source: EstimationError,
    },
    /// Nothing to put together.
    #[error("there are no factors to merge: give at least one")]
    Empty,
    /// Factors of another robot, or made with other settings.
    #[error("factors of different studies cannot be merged: {} differ; reduce all logs with one study (and like one model)", sections.iter().map(|name| format!("[{name}]")).collect::<Vec<_>>().join(", "))]
    Unlike {
        /// The sections that differ.
        sections: Vec<String>,
    },
    /// A study with code in it.
    #[error("{part} is a function of a caller, and factors hold no code: identify from the logs themselves")]
    Function {
        /// Which part, and what its function is called.
        part: String,
    },
    /// A study that needs a file beside it.
    #[error("the torque table {file} lies beside the study, and factors hold no files: leave this torque out")]
    Table {
        /// The file.
        file: String,
    },
}
