//! Atomic file output.

use crate::error::Error;
use std::path::Path;

/// Writes `contents` to `path` through a temporary file in the same folder. Readers see either the old or the new
/// file, and after an error the old file remains. Old temporary files of this file are removed.
///
/// # Errors
/// [`Error::Output`] with the reason from the operating system.
pub fn write_atomically(path: &Path, contents: &[u8]) -> Result<(), Error> {
    dynident_system::write_atomically(path, contents).map_err(|source| Error::Output { path: path.to_owned(), source })
}

/// Checks, before a long job, whether [`write_atomically`] can write into `folder`, which need not exist. Leaves no
/// files.
///
/// # Errors
/// [`Error::Output`] with the reason from the operating system.
pub fn check_writable(folder: &Path) -> Result<(), Error> {
    dynident_system::check_writable(folder).map_err(|source| Error::Output { path: folder.to_owned(), source })
}
