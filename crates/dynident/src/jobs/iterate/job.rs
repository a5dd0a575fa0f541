//! One call of the iteration: its study, its folder and its options.

use crate::error::{Error, StudyError};
use crate::jobs::options::RunOptions;
use crate::study::Study;
use dynident_iteration::IterationError;
use std::path::Path;

/// The study, the folder of the results and the options of one call.
#[derive(Clone, Copy)]
pub(super) struct Job<'a> {
    pub(super) study: &'a Study,
    pub(super) study_path: &'a Path,
    /// Folder of all results.
    pub(super) out: &'a Path,
    /// Whether runs that are already in the folder are kept.
    pub(super) resume: bool,
    pub(super) options: &'a RunOptions<'a>,
}

impl Job<'_> {
    /// An error in the table `[iteration]` of the study.
    pub(super) fn section_error(&self, why: StudyError) -> Error {
        Error::section(self.study_path, "iteration")(why)
    }

    /// An error of the iteration: of a file, of the state in the folder, or of the table `[iteration]`.
    pub(super) fn iteration_error(&self, error: IterationError) -> Error {
        match error {
            IterationError::File { path, source } => Error::Output { path, source },
            IterationError::State { path, problem } => Error::Result { path, message: problem },
            other => self.section_error(other.into()),
        }
    }
}
