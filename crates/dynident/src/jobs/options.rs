//! How a job runs, and what a study is called.

use crate::study::Study;
use dynident_identification::{Execution, Progress};
use std::path::{Path, PathBuf};

/// How a job runs; not what it computes.
pub struct RunOptions<'a> {
    /// Folder of the recordings, in place of the study's own.
    pub data: Option<PathBuf>,
    /// Threads that compute; the result is the same for any number.
    pub threads: usize,
    /// Hears how far the job has come.
    pub progress: &'a dyn Progress,
}

impl<'a> RunOptions<'a> {
    /// The same for an identification.
    pub(crate) fn execution(&self) -> Execution<'a> {
        Execution { threads: self.threads, progress: self.progress }
    }
}

/// What a study is called.
pub(crate) fn study_name(study: &Study, path: &Path) -> String {
    let stem = || path.file_stem().map_or_else(|| "study".to_owned(), |stem| stem.to_string_lossy().into_owned());
    study.name.clone().unwrap_or_else(stem)
}
