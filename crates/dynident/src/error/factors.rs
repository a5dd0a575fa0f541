//! Errors of factor files.

use dynident_estimation::EstimationError;
use thiserror::Error;

/// Reason why factors cannot be read or merged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FactorsError {
    /// The file was not written by `dynident reduce`. Give a factor file.
    #[error("this is not a factor file: give a file that `dynident reduce` wrote")]
    Kind,
    /// Another version of Dynident wrote the file. Run `dynident reduce` again with this version.
    #[error(
        "version {found} of the format; this program reads version {known}: run `dynident reduce` on the logs again"
    )]
    Version {
        /// Version in the file.
        found: u32,
        /// Version that this program reads.
        known: u32,
    },
    /// The file is not complete, usually because a copy was interrupted.
    #[error("truncated file ({bytes} bytes): copy it again")]
    Short {
        /// Length of the file, bytes.
        bytes: usize,
    },
    /// The content of the file changed after it was written, usually by a faulty copy.
    #[error("corrupt file (hash mismatch): copy it again")]
    Hash,
    /// The file is intact, but its header is not that of this version. Run `dynident reduce` again.
    #[error("unreadable header: {problem}; run `dynident reduce` on the logs again")]
    Header {
        /// The problem.
        problem: String,
    },
    /// The factor of this log contains numbers that are not finite or of the wrong size. Run `dynident reduce` on the
    /// log again.
    #[error("log {log}: {source}; run `dynident reduce` on this log again")]
    Numbers {
        /// Name of the log.
        log: String,
        /// The problem.
        source: EstimationError,
    },
    /// The command got no factor file. Name at least one.
    #[error("no factors to merge: give at least one file")]
    Empty,
    /// Factors can only be added if all were computed for the same robot with the same settings. Run `dynident reduce`
    /// on all logs with one study.
    #[error("factors of different studies cannot be merged: {} differ; reduce all logs with the same study (and the same --like model)", sections.iter().map(|name| format!("[{name}]")).collect::<Vec<_>>().join(", "))]
    Unlike {
        /// Names of the sections that differ.
        sections: Vec<String>,
    },
    /// The study uses a function of a calling program, such as an own friction law, and a file cannot contain it.
    /// Identify from the logs in that program.
    #[error(
        "{part} is a function of the calling program, but factor files cannot contain code: run `identify` on the logs"
    )]
    Function {
        /// The part of the study, with the name of its function.
        part: String,
    },
    /// The study takes a torque from a `table_file`. Write its points as `table` into the study, or remove the
    /// `[[torque]]`.
    #[error("the torque table {file} is a separate file, but factor files cannot contain files: remove this torque")]
    Table {
        /// The file.
        file: String,
    },
}
