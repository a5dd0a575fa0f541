//! Safe reading of input files: opens regular files only, reads a limited number of bytes, detects files that change
//! while they are read, and quotes their text in messages.
//!
//! ```
//! use dynident_files::{SeenFiles, read};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("log.csv");
//! std::fs::write(&path, "t,q\n0,1\n")?;
//! let seen = SeenFiles::default();
//! assert!(seen.is_unchanged(&path)?);
//! assert_eq!(read(&path, 1 << 20)?.len(), 8);
//! std::fs::write(&path, "t,q\n0,1\n0.1,2\n")?;
//! assert_eq!(seen.first_changed(), Some(path));
//! # Ok::<(), std::io::Error>(())
//! ```
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::fs::{File, Metadata};
use std::io::{self, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// Opens a regular file for reading.
///
/// # Errors
/// If the system reports an error, or the path is a folder, a named pipe, a device or a socket: those may block or have
/// no end, and inputs are read more than once. [`io::ErrorKind::InvalidData`] for a pointer of Git LFS in place of the
/// file.
pub fn open(path: &Path) -> io::Result<File> {
    let metadata = std::fs::metadata(path)?;
    require_regular(&metadata)?;
    let mut file = File::open(path)?;
    if metadata.len() < MOST_POINTER_BYTES {
        let mut start = Vec::new();
        Read::by_ref(&mut file).take(LFS_POINTER.len() as u64).read_to_end(&mut start)?;
        if start == LFS_POINTER {
            let problem = "it is a Git LFS pointer, not the file itself: run `git lfs pull` in its repository";
            return Err(io::Error::new(io::ErrorKind::InvalidData, problem));
        }
        file.rewind()?;
    }
    Ok(file)
}

/// First bytes of a pointer, and a size that no pointer reaches (the specification: less than 1024 bytes).
const LFS_POINTER: &[u8] = b"version https://git-lfs.github.com/spec/v1\n";
const MOST_POINTER_BYTES: u64 = 1024;

/// Reads a whole regular file of at most `max_bytes`.
///
/// # Errors
/// As [`open`], and [`io::ErrorKind::FileTooLarge`] for a longer file. At most `max_bytes` are read.
pub fn read(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // The length that the system reports may be wrong.
    open(path)?.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes {
        let problem = format!("it is larger than {} MiB", max_bytes >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, problem));
    }
    Ok(bytes)
}

/// Reads a whole text file as [`read`] does.
///
/// # Errors
/// As [`read`], and [`io::ErrorKind::InvalidData`] for bytes that are not UTF-8.
pub fn read_text(path: &Path, max_bytes: u64) -> io::Result<String> {
    String::from_utf8(read(path, max_bytes)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text"))
}

fn require_regular(metadata: &Metadata) -> io::Result<()> {
    if metadata.is_file() {
        return Ok(());
    }
    if metadata.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let problem =
        format!("it is {}, not a regular file: copy its content into a file and name that file", kind(metadata));
    Err(io::Error::new(io::ErrorKind::InvalidInput, problem))
}

#[cfg(unix)]
fn kind(metadata: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = metadata.file_type();
    if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn kind(_: &Metadata) -> &'static str {
    "a device or a pipe"
}

const MAX_QUOTED_CHARS: usize = 60;

/// Quotes a text from an input for a message: control characters are escaped, and a long text is cut and followed by
/// its length.
pub fn quoted(text: &str) -> String {
    let shown: String = text.chars().take(MAX_QUOTED_CHARS).flat_map(char::escape_debug).collect();
    match text.chars().count() {
        all if all > MAX_QUOTED_CHARS => format!("{shown}.. ({all} characters)"),
        _ => shown,
    }
}

/// Identity of a file: length, modification time and, on Unix, device and inode. A file that is overwritten in place
/// with the same length within the resolution of the file system's clock is not detected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileIdentity {
    bytes: u64,
    modified: Option<SystemTime>,
    place: (u64, u64),
}

impl FileIdentity {
    /// Reads the identity of the file at `path`, following links.
    ///
    /// # Errors
    /// If the system reports an error.
    pub fn of(path: &Path) -> io::Result<Self> {
        let metadata = std::fs::metadata(path)?;
        Ok(Self { bytes: metadata.len(), modified: metadata.modified().ok(), place: place(&metadata) })
    }
}

#[cfg(unix)]
fn place(metadata: &Metadata) -> (u64, u64) {
    use std::os::unix::fs::MetadataExt;
    (metadata.dev(), metadata.ino())
}

#[cfg(not(unix))]
fn place(_: &Metadata) -> (u64, u64) {
    (0, 0)
}

/// Files with their identity when they were first seen.
#[derive(Debug, Default)]
pub struct SeenFiles {
    first: Mutex<BTreeMap<PathBuf, FileIdentity>>,
}

impl SeenFiles {
    /// Whether the file at `path` is the same as in the first call with this path; true for the first call.
    ///
    /// # Errors
    /// If the identity of a new file cannot be read. A seen file that is missing has changed.
    pub fn is_unchanged(&self, path: &Path) -> io::Result<bool> {
        let found = FileIdentity::of(path);
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = first.get(path) {
            return Ok(found.is_ok_and(|found| found == *known));
        }
        first.insert(path.to_owned(), found?);
        Ok(true)
    }

    /// The first path in alphabetical order whose file has changed.
    pub fn first_changed(&self) -> Option<PathBuf> {
        let first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        let changed =
            |(path, known): &(&PathBuf, &FileIdentity)| !FileIdentity::of(path).is_ok_and(|now| now == **known);
        first.iter().find(changed).map(|(path, _)| path.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaced_modified_and_removed_files_have_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let change: [&dyn Fn(); 3] = [
            &|| {
                // Same length and content, but another file.
                let other = folder.path().join("b");
                std::fs::write(&other, "abc").unwrap();
                std::fs::rename(&other, &path).unwrap();
            },
            &|| std::fs::write(&path, "abcd").unwrap(),
            &|| std::fs::remove_file(&path).unwrap(),
        ];
        for change in change {
            std::fs::write(&path, "abc").unwrap();
            let seen = SeenFiles::default();
            assert!(seen.is_unchanged(&path).unwrap() && seen.is_unchanged(&path).unwrap());
            assert_eq!(seen.first_changed(), None);
            change();
            // Without inodes, only the modification time distinguishes the first case.
            assert!(cfg!(not(unix)) || seen.first_changed().is_some() && !seen.is_unchanged(&path).unwrap());
        }
        assert!(SeenFiles::default().is_unchanged(&path).is_err());
    }

    #[test]
    fn reading_is_limited() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, vec![b'a'; 3 << 20]).unwrap();
        assert_eq!(read(&path, 3 << 20).unwrap().len(), 3 << 20);
        let error = read(&path, 2 << 20).unwrap_err();
        assert_eq!((error.kind(), &error.to_string()[..]), (io::ErrorKind::FileTooLarge, "it is larger than 2 MiB"));
        assert_eq!(open(folder.path()).unwrap_err().kind(), io::ErrorKind::IsADirectory);
    }

    #[test]
    fn a_long_text_is_quoted_by_its_beginning() {
        assert_eq!(quoted("q1\n"), "q1\\n");
        assert_eq!(quoted(&"é".repeat(60)), "é".repeat(60));
        assert_eq!(quoted(&"(".repeat(200_000)), format!("{}.. (200000 characters)", "(".repeat(60)));
    }

    #[test]
    fn a_git_lfs_pointer_is_not_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.csv");
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 123\n";
        std::fs::write(&path, pointer).unwrap();
        let error = read(&path, 1 << 20).unwrap_err();
        assert!(error.to_string().contains("run `git lfs pull`"), "{error}");
        // Other short files are read from their start.
        for text in ["", "version", "version https://git-lfs.github.com/spec/v2\n"] {
            std::fs::write(&path, text).unwrap();
            assert_eq!(read_text(&path, 1 << 20).unwrap(), text);
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_without_a_writer_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let error = read_text(&path, 1 << 20).unwrap_err().to_string();
        assert!(error.contains("a pipe") && error.contains("copy its content"), "{error}");
        assert!(open(Path::new("/dev/zero")).unwrap_err().to_string().contains("a device"));
    }
}
