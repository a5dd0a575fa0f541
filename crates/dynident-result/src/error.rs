//! Errors of result files.

use dynident_study::StudyFileError;
use std::path::PathBuf;
use thiserror::Error;

/// Reason why a result file cannot be used. Each message contains the file and the fix.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ResultFileError {
    /// The result file does not exist, or you have no permission to read it. Give the `result.json` that `identify`
    /// wrote.
    #[error("{}: cannot be read: {source}; check the path and the permissions", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Reason from the operating system.
        source: std::io::Error,
    },
    /// The file is damaged, was changed by hand, is of an incompatible version, or belongs to another robot or study.
    /// Run `identify` again and use its new result.
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
