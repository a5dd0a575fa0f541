//! Folders of a study's files.

use super::Study;
use crate::error::StudyFileError;
use std::path::{Path, PathBuf};

/// Search path for a study's files: the folder from the command line, then the study file's folder, then the study's
/// `data`.
#[derive(Clone, Debug)]
pub struct Folders {
    /// The folder from the command line.
    named: Option<PathBuf>,
    candidates: Vec<PathBuf>,
}

impl Folders {
    /// Search path of the study in `study_path`; `data` is the folder from the command line.
    pub fn new(study: &Study, study_path: &Path, data: Option<&Path>) -> Self {
        let own = study_path.parent().map_or_else(PathBuf::new, Path::to_owned);
        let mut candidates: Vec<PathBuf> = data.map(Path::to_owned).into_iter().collect();
        candidates.push(own.clone());
        candidates.extend(study.data.as_ref().map(|data| own.join(data)));
        Self { named: data.map(Path::to_owned), candidates }
    }

    /// Finds the first folder that contains `file`.
    ///
    /// # Errors
    /// If the folder from the command line does not exist, or if no folder contains the file; the message lists all
    /// paths tried, and the study's source if stated.
    pub fn find(&self, file: &Path, source: Option<&str>) -> Result<PathBuf, StudyFileError> {
        if let Some(folder) = self.named.as_ref().filter(|folder| !folder.is_dir()) {
            let source = std::io::Error::from(std::io::ErrorKind::NotADirectory);
            return Err(StudyFileError::File { path: folder.clone(), source });
        }
        let tried: Vec<PathBuf> = self.candidates.iter().map(|folder| folder.join(file)).collect();
        tried.iter().find(|path| path.exists() && !path.is_dir() || is_recording(path)).cloned().ok_or_else(|| {
            StudyFileError::Missing { file: file.to_owned(), tried, source_of_data: source.map(str::to_owned) }
        })
    }
}

/// Whether `path` is the folder of a rosbag2 recording, of a `LeRobot` data set or of a SAGE recording.
fn is_recording(path: &Path) -> bool {
    let has = |file: &str| path.join(file).is_file();
    has("metadata.yaml") || has("meta/info.json") || has("control.csv") && has("state_motor.csv")
}
