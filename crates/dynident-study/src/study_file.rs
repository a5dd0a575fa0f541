//! A study with the path of its file.

use super::{Folders, Study, StudyRobot};
use crate::error::StudyFileError;
use core::ops::Deref;
use std::path::{Component, Path};

/// A study with the path of its file. Relative paths in the study begin at the folder of the file, and messages name
/// the file. For a study built in memory the path is only a name.
#[derive(Clone, Copy, Debug)]
pub struct StudyFile<'a> {
    /// The study.
    pub study: &'a Study,
    /// Path of its file.
    pub path: &'a Path,
}

impl Deref for StudyFile<'_> {
    type Target = Study;

    fn deref(&self) -> &Study {
        self.study
    }
}

impl<'a> StudyFile<'a> {
    /// The study in the file at `path`.
    pub fn new(study: &'a Study, path: &'a Path) -> Self {
        Self { study, path }
    }

    /// A changed copy of the study with the same path.
    pub fn with_study<'b>(self, study: &'b Study) -> StudyFile<'b>
    where
        'a: 'b,
    {
        StudyFile { study, path: self.path }
    }

    /// Folder of the file; empty for the current folder.
    pub fn folder(self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The name in the study, or the name of its file without extension.
    pub fn title(self) -> String {
        let stem = self.path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
        self.study.name.clone().or(stem).unwrap_or_else(|| "study".to_owned())
    }

    /// Search path of the files of the study; `data` is the folder from the command line.
    pub fn folders(self, data: Option<&Path>) -> Folders {
        Folders::new(self.study, self.path, data)
    }

    /// Builds the robot of the study.
    ///
    /// # Errors
    /// Same as for [`StudyRobot::new`].
    pub fn robot_in(self, folders: &Folders) -> Result<StudyRobot, StudyFileError> {
        StudyRobot::new(self.study, self.path, folders)
    }

    /// Path of a file relative to the folder of the study, with `/`; only the file name if there is no relative path.
    pub fn relative(self, file: &Path) -> String {
        relative_path(self.folder(), file).unwrap_or_else(|| name_of(file))
    }
}

fn name_of(file: &Path) -> String {
    file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Path of a file relative to a folder, with `/`. `None` if one of them is missing, or if they are on different drives.
pub fn relative_path(folder: &Path, file: &Path) -> Option<String> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    relative(&folder.canonicalize().ok()?, &file.canonicalize().ok()?)
}

fn relative(folder: &Path, file: &Path) -> Option<String> {
    let [from, to] = [folder, file].map(|path| path.components().collect::<Vec<_>>());
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[common..].iter().map(|_| Component::ParentDir);
    let parts: Vec<_> =
        up.chain(to[common..].iter().copied()).map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    (common > 0).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_go_up_and_down() {
        let seen = |path: &str, folder: &str| relative(Path::new(folder), Path::new(path)).unwrap();
        assert_eq!(seen("/a/b/c.csv", "/a/b"), "c.csv");
        assert_eq!(seen("/a/b/c.csv", "/a/d/e"), "../../b/c.csv");
        assert_eq!(seen("/c.csv", "/a"), "../c.csv");
        assert_eq!(relative_path(Path::new("missing"), Path::new("missing/x.csv")), None);
    }
}
