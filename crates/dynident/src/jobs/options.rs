//! Execution options of a job.

use dynident_identification::{Execution, Progress};
use std::path::PathBuf;

/// Execution options of a job; they do not influence the result.
pub struct RunOptions<'a> {
    /// Folder of the recordings, which replaces that of the study.
    pub data: Option<PathBuf>,
    /// Number of threads; the result does not depend on it.
    pub threads: usize,
    /// Receives the progress of the job.
    pub progress: &'a dyn Progress,
}

impl<'a> RunOptions<'a> {
    pub(crate) fn execution(&self) -> Execution<'a> {
        Execution { threads: self.threads, progress: self.progress }
    }
}
