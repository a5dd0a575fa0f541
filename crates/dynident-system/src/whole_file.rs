//! Files that appear complete or not at all, and cleanup of temporary files of killed writers.

use crate::folder::names;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use tempfile::{Builder, NamedTempFile};

/// Separator between file name and random part in the name of a temporary file: `.model.json.dynident-a1b2c3`.
const MARK: &str = ".dynident-";
/// Number of random characters at the end of the name of a temporary file.
const RANDOM_CHARACTERS: usize = 6;
/// Maximum length of the file's name in that of its temporary file, bytes; file systems allow 255 for both.
const MAX_NAME_BYTES: usize = 200;
/// Maximum number of attempts to create a temporary file that no other writer treats as abandoned.
const ATTEMPTS: usize = 100;

/// Writes a file through a temporary file in the same folder. A reader finds the old or the new file, never a part, and
/// an error changes nothing. A symbolic link is replaced by the file. Temporary files that killed writers left for this
/// file are removed; those of running writers are locked and stay.
///
/// # Errors
/// Error of the operating system, and [`io::ErrorKind::InvalidInput`] for a device, a pipe or a socket, which the file
/// would replace: a superuser would lose `/dev/null` or `/dev/stdout`.
pub fn write_atomically(path: &Path, contents: &[u8]) -> io::Result<()> {
    if is_special(path) {
        let problem = "it is a device, a pipe or a socket, which would be replaced: give the name of a regular file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let prefix = temporary_prefix(path.file_name().unwrap_or_default());
    remove_abandoned(folder, &prefix);
    let mut file = created(folder, &prefix)?;
    file.write_all(contents)?;
    file.as_file().sync_all()?;
    // A temporary file is private to its owner; a result is readable for all users that can enter the folder.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
    }
    file.persist(path).map(drop).map_err(|error| error.error)
}

/// Whether a path leads to a device, a pipe or a socket, or through a link to an open file of this process:
/// `/dev/stdout` is a link into `/proc`, even if standard output is a regular file.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
        || fs::read_link(path).is_ok_and(|target| target.starts_with("/proc"))
}

/// Tests whether a file can be created in `folder`, or in its nearest existing parent. Creates no permanent file.
///
/// # Errors
/// Error of the operating system.
pub fn check_writable(folder: &Path) -> io::Result<()> {
    let nearest = folder.ancestors().find(|ancestor| ancestor.exists() || ancestor.as_os_str().is_empty());
    let nearest = nearest.filter(|ancestor| !ancestor.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // On Linux an unnamed file, which disappears even if the program is killed.
    tempfile::tempfile_in(nearest).map(drop)
}

/// Prefix of the temporary files of a file.
fn temporary_prefix(name: &OsStr) -> String {
    let name = name.to_string_lossy();
    let end = (0..=name.len().min(MAX_NAME_BYTES)).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
    format!(".{}{MARK}", &name[..end])
}

/// A new temporary file, locked while open.
fn created(folder: &Path, prefix: &str) -> io::Result<NamedTempFile> {
    for _ in 0..ATTEMPTS {
        let file = Builder::new().prefix(prefix).rand_bytes(RANDOM_CHARACTERS).tempfile_in(folder)?;
        // Another writer may have removed it before it was locked. On systems without locks nobody removes it.
        let _ = file.as_file().lock();
        if file.path().exists() {
            return Ok(file);
        }
    }
    Err(io::Error::new(io::ErrorKind::WouldBlock, "other writers keep removing the temporary file"))
}

/// Removes temporary files of ended writers. Errors are ignored.
fn remove_abandoned(folder: &Path, prefix: &str) {
    for name in names(folder).unwrap_or_default() {
        let is_temporary = name.to_str().and_then(|name| name.strip_prefix(prefix)).is_some_and(|random| {
            random.len() == RANDOM_CHARACTERS && random.bytes().all(|byte| byte.is_ascii_alphanumeric())
        });
        let path = folder.join(&name);
        if is_temporary && fs::symlink_metadata(&path).is_ok_and(|found| found.is_file()) {
            // A running writer holds the lock.
            if let Ok(file) = File::open(&path)
                && file.try_lock().is_ok()
            {
                let _ = fs::remove_file(&path);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn abandoned_temporary_files_are_removed_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.json");
        let running = created(folder.path(), &temporary_prefix(OsStr::new("model.json"))).unwrap();
        let others = [
            ".model.json.dynident-a1b2c",
            ".model.json.dynident-a1b2c-",
            ".model.json.dynident-a1b2c34",
            ".other.json.dynident-a1b2c3",
            ".tmpa1b2c3",
            "model.json.dynident-a1b2c3",
        ];
        for name in others.iter().chain(&[".model.json.dynident-a1b2c3", ".model.json.dynident-ZZZZZZ"]) {
            fs::write(folder.path().join(name), "").unwrap();
        }
        fs::create_dir(folder.path().join(".model.json.dynident-folder")).unwrap();
        write_atomically(&path, b"text").unwrap();
        let mut expected: Vec<_> = others.iter().map(|name| OsStr::new(name).to_owned()).collect();
        expected.extend([".model.json.dynident-folder", "model.json"].map(|name| OsStr::new(name).to_owned()));
        expected.push(running.path().file_name().unwrap().to_owned());
        expected.sort();
        assert_eq!(names(folder.path()).unwrap(), expected);
        assert_eq!(fs::read(&path).unwrap(), b"text");
        drop(running);
    }

    #[test]
    fn writers_at_the_same_time_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.json");
        std::thread::scope(|scope| {
            for writer in 0..4_u8 {
                let path = &path;
                scope.spawn(move || (0..50).for_each(|_| write_atomically(path, &[writer; 1000]).unwrap()));
            }
        });
        let written = fs::read(&path).unwrap();
        assert!(written.len() == 1000 && written.iter().all(|byte| *byte == written[0]));
        assert_eq!(names(folder.path()).unwrap(), ["model.json"]);
    }

    #[cfg(unix)]
    #[test]
    fn only_regular_files_and_links_are_replaced() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let refused =
            |path: &Path| assert_eq!(write_atomically(path, b"text").unwrap_err().kind(), io::ErrorKind::InvalidInput);
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        symlink("/dev/null", at("device")).unwrap();
        symlink("/proc/self/fd/1", at("stdout")).unwrap();
        for name in ["pipe", "device", "stdout"] {
            refused(&at(name));
        }
        assert!(!fs::metadata(at("pipe")).unwrap().is_file() && at("device").is_symlink());
        fs::write(at("other"), "old").unwrap();
        symlink(at("other"), at("link")).unwrap();
        write_atomically(&at("link"), b"text").unwrap();
        assert_eq!(
            (fs::read(at("link")).unwrap(), fs::read(at("other")).unwrap()),
            (b"text".to_vec(), b"old".to_vec())
        );
        assert_eq!(names(folder.path()).unwrap(), ["device", "link", "other", "pipe", "stdout"]);
    }

    #[test]
    fn long_names_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("λ".repeat(127));
        write_atomically(&path, b"text").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"text");
        assert_eq!(names(folder.path()).unwrap().len(), 1);
    }
}
