//! Folders that are removed after use, even if a program was killed.

use crate::folder::{names, remove_folder};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::Builder;

const PREFIX: &str = ".dynident-temporary-";
const RANDOM_CHARACTERS: usize = 6;
/// Maximum number of attempts to create a folder that no other program treats as abandoned.
const ATTEMPTS: usize = 100;

/// A folder that is removed with all its contents on drop. Unlike in `tempfile`, removing it never panics.
#[derive(Debug)]
pub struct TemporaryFolder {
    path: PathBuf,
    is_kept: bool,
    /// Locked while open, so that no other program treats the folder as abandoned.
    _lock: Option<File>,
}

impl TemporaryFolder {
    /// Creates a folder in the system's temporary folder, and removes folders that killed programs left there.
    ///
    /// # Errors
    /// Error of the operating system.
    pub fn new() -> io::Result<Self> {
        Self::locked_in(&std::env::temp_dir())
    }

    fn locked_in(parent: &Path) -> io::Result<Self> {
        remove_abandoned(parent);
        for _ in 0..ATTEMPTS {
            let path = created(parent, PREFIX, 0o700)?;
            let lock = File::open(&path).ok();
            // Another program may have removed it before it was locked. On systems without locks nobody removes it.
            let _ = lock.as_ref().map(File::lock);
            if path.exists() {
                return Ok(Self { path, is_kept: false, _lock: lock });
            }
        }
        Err(io::Error::new(io::ErrorKind::WouldBlock, "other programs keep removing the temporary folder"))
    }

    /// Creates a folder in `parent` with a name that begins with `prefix`. Only its owner can access it.
    ///
    /// # Errors
    /// Error of the operating system.
    pub fn create_in(parent: &Path, prefix: &str) -> io::Result<Self> {
        Ok(Self { path: created(parent, prefix, 0o700)?, is_kept: false, _lock: None })
    }

    /// As [`create_in`](Self::create_in), with the access rights of the user's mask.
    ///
    /// # Errors
    /// Error of the operating system.
    pub fn create_open_in(parent: &Path, prefix: &str) -> io::Result<Self> {
        Ok(Self { path: created(parent, prefix, 0o777)?, is_kept: false, _lock: None })
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of the folder, which is then not removed on drop.
    pub fn keep(mut self) -> PathBuf {
        self.is_kept = true;
        self.path.clone()
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        if !self.is_kept {
            // The next program removes the remaining parts.
            let _ = remove_folder(&self.path);
        }
    }
}

/// A new folder with an access mode, reduced by the user's mask.
#[cfg_attr(not(unix), allow(unused_variables, reason = "other systems have no such mode"))]
fn created(parent: &Path, prefix: &str, mode: u32) -> io::Result<PathBuf> {
    let mut builder = Builder::new();
    builder.prefix(prefix).rand_bytes(RANDOM_CHARACTERS);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    Ok(builder.tempdir_in(parent)?.keep())
}

/// Removes the temporary folders of ended programs in `parent`. Errors are ignored.
fn remove_abandoned(parent: &Path) {
    for name in names(parent).unwrap_or_default() {
        let is_temporary = name.to_str().and_then(|name| name.strip_prefix(PREFIX)).is_some_and(|random| {
            random.len() == RANDOM_CHARACTERS && random.bytes().all(|byte| byte.is_ascii_alphanumeric())
        });
        let path = parent.join(&name);
        if is_temporary
            && fs::symlink_metadata(&path).is_ok_and(|found| found.is_dir())
            && let Ok(folder) = File::open(&path)
            && folder.try_lock().is_ok()
        {
            let _ = remove_folder(&path);
        }
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_killed_programs_are_removed_and_no_others() {
        let parent = tempfile::tempdir().unwrap();
        let running = TemporaryFolder::locked_in(parent.path()).unwrap();
        fs::write(running.path().join("file"), "").unwrap();
        let others = ["dynident-a1b2c3", ".dynident-temporary-a1b2c", ".dynident-temporary-a1b2c34"];
        for name in others.iter().chain(&[".dynident-temporary-a1b2c3"]) {
            fs::create_dir_all(parent.path().join(name).join("below")).unwrap();
        }
        let kept = running.path().to_owned();
        let next = TemporaryFolder::locked_in(parent.path()).unwrap();
        assert!(kept.join("file").exists() && !parent.path().join(".dynident-temporary-a1b2c3").exists());
        assert!(others.iter().all(|name| parent.path().join(name).exists()));
        drop((running, next));
        assert_eq!(names(parent.path()).unwrap().len(), others.len());
        let kept = TemporaryFolder::create_in(parent.path(), "x-").unwrap().keep();
        assert!(kept.is_dir());
    }
}
