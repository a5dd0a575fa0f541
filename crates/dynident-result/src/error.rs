//! Errors of result files.

use dynident_study::StudyFileError;
use std::path::PathBuf;
use thiserror::Error;

/// Reason why a result file cannot be used. Each message contains the file and the fix.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResultFileError {
    /// A file that cannot be read.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// A content that is invalid or does not belong to the study.
    #[error("{}: {message}", path.display())]
    Content {
        /// The result file.
        path: PathBuf,
        /// The problem and the fix.
        message: String,
    },
    /// An error of the study.
    #[error("{0}")]
    Study(#[from] StudyFileError),
}
