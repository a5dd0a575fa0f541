//! Where a study's files lie.

use super::Study;
use crate::error::Error;
use std::path::{Path, PathBuf};

/// Where a study's files lie: the folder that the user named, then the study file's own, then the study's `data`.
#[derive(Clone, Debug)]
pub struct Folders {
    /// What the user named.
    named: Option<PathBuf>,
    candidates: Vec<PathBuf>,
}

impl Folders {
    /// The folders of the study in `study_path`; `data` is what the user named on the command line.
    pub fn new(study: &Study, study_path: &Path, data: Option<&Path>) -> Self {
        let own = study_path.parent().map_or_else(PathBuf::new, Path::to_owned);
        let mut candidates: Vec<PathBuf> = data.map(Path::to_owned).into_iter().collect();
        candidates.push(own.clone());
        candidates.extend(study.data.as_ref().map(|data| own.join(data)));
        Self { named: data.map(Path::to_owned), candidates }
    }

    /// The first folder that holds `file`.
    ///
    /// # Errors
    /// If the folder that the user named is none, and if no folder holds it; the message names all that were tried, and
    /// the study's source if it says one.
    pub fn find(&self, file: &Path, source: Option<&str>) -> Result<PathBuf, Error> {
        if let Some(folder) = self.named.as_ref().filter(|folder| !folder.is_dir()) {
            let source = std::io::Error::from(std::io::ErrorKind::NotADirectory);
            return Err(Error::File { path: folder.clone(), source });
        }
        let tried: Vec<PathBuf> = self.candidates.iter().map(|folder| folder.join(file)).collect();
        tried
            .iter()
            .find(|path| path.exists() && !path.is_dir() || is_recording(path))
            .cloned()
            .ok_or_else(|| Error::Missing { file: file.to_owned(), tried, source_of_data: source.map(str::to_owned) })
    }
}

/// Whether `path` is the folder of a rosbag2 recording.
fn is_recording(path: &Path) -> bool {
    path.join("metadata.yaml").is_file()
}
