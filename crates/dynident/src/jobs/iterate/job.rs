//! One call of the iteration: study, folder and options.

use crate::error::{Error, StudyError};
use crate::jobs::options::RunOptions;
use crate::study::StudyFile;
use dynident_iteration::IterationError;
use std::path::Path;

#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) study: StudyFile<'a>,
    pub(super) out: &'a Path,
    /// Whether to keep the runs in the folder.
    pub(super) resume: bool,
    pub(super) options: &'a RunOptions<'a>,
}

impl Job<'_> {
    pub(super) fn section_error(&self, why: StudyError) -> Error {
        Error::section(self.study.path, "iteration")(why)
    }

    /// Assigns an error of the iteration to a file, to the state in the folder, or to the table `[iteration]`.
    pub(super) fn iteration_error(&self, error: IterationError) -> Error {
        match error {
            IterationError::File { path, source } => Error::Output { path, source },
            IterationError::State { path, problem } => Error::Result { path, message: problem },
            other => self.section_error(other.into()),
        }
    }
}
