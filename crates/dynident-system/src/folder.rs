//! Lists and removes folders with errors instead of panics. The standard library's `read_dir`, and thereby
//! `remove_dir_all`, panics if the system cannot close a folder (missing network drive, broken disk).

use std::ffi::OsString;
use std::io;
use std::path::Path;

/// Names in a folder, sorted.
///
/// # Errors
/// Error of the operating system.
pub fn names(folder: &Path) -> io::Result<Vec<OsString>> {
    let mut names = system::names(folder)?;
    names.sort();
    Ok(names)
}

/// Removes a folder with all its contents. Symbolic links are removed, never followed.
///
/// # Errors
/// Error of the operating system; a part may then have been removed.
pub fn remove_folder(folder: &Path) -> io::Result<()> {
    system::remove_folder(folder)
}

#[cfg(unix)]
mod system {
    use rustix::fd::{AsFd, BorrowedFd, OwnedFd};
    use rustix::fs::{AtFlags, CWD, Dir, Mode, OFlags, openat, unlinkat};
    use rustix::io::Errno;
    use std::ffi::{OsStr, OsString};
    use std::io;
    use std::os::unix::ffi::OsStrExt;
    use std::path::Path;

    pub(super) fn names(folder: &Path) -> io::Result<Vec<OsString>> {
        let opened = openat(CWD, folder, OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
        names_in(opened)
    }

    fn names_in(folder: OwnedFd) -> io::Result<Vec<OsString>> {
        let mut names = Vec::new();
        for entry in Dir::new(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_bytes();
            if name != b"." && name != b".." {
                names.push(OsStr::from_bytes(name).to_owned());
            }
        }
        Ok(names)
    }

    pub(super) fn remove_folder(folder: &Path) -> io::Result<()> {
        remove_folder_at(CWD, folder.as_os_str())
    }

    fn remove_folder_at(parent: BorrowedFd<'_>, name: &OsStr) -> io::Result<()> {
        let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        let folder = openat(parent, name, flags, Mode::empty())?;
        for inside in names_in(folder.try_clone()?)? {
            match unlinkat(folder.as_fd(), &inside, AtFlags::empty()) {
                Ok(()) => {}
                // Linux returns EISDIR for a folder, POSIX EPERM.
                Err(Errno::ISDIR | Errno::PERM) => remove_folder_at(folder.as_fd(), &inside)?,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(unlinkat(parent, name, AtFlags::REMOVEDIR)?)
    }
}

#[cfg(not(unix))]
mod system {
    use std::ffi::OsString;
    use std::path::Path;
    use std::{fs, io};

    pub(super) fn names(folder: &Path) -> io::Result<Vec<OsString>> {
        fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
    }

    pub(super) fn remove_folder(folder: &Path) -> io::Result<()> {
        fs::remove_dir_all(folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_folder_is_listed_in_order_and_removed_with_its_contents() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("folder");
        fs::create_dir_all(folder.join("below/deeper")).unwrap();
        for name in ["b", "a", "below/c", "below/deeper/d"] {
            fs::write(folder.join(name), "").unwrap();
        }
        assert_eq!(names(&folder).unwrap(), ["a", "b", "below"]);
        remove_folder(&folder).unwrap();
        assert!(!folder.exists());
        assert_eq!(names(&folder).unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(remove_folder(&folder).unwrap_err().kind(), io::ErrorKind::NotFound);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_removed_and_not_followed() {
        let root = tempfile::tempdir().unwrap();
        let (folder, other) = (root.path().join("folder"), root.path().join("other"));
        fs::create_dir_all(&folder).unwrap();
        fs::create_dir_all(&other).unwrap();
        fs::write(other.join("kept"), "").unwrap();
        std::os::unix::fs::symlink(&other, folder.join("link")).unwrap();
        std::os::unix::fs::symlink(&folder, root.path().join("to_folder")).unwrap();
        assert!(remove_folder(&root.path().join("to_folder")).is_err() && folder.exists());
        remove_folder(&folder).unwrap();
        assert!(!folder.exists() && other.join("kept").exists());
    }
}
