//! Files appear whole or not at all.

use crate::error::Error;
use std::path::Path;

/// Writes `contents` to `path` through a temporary file in the same folder: a reader finds the old file or the new one,
/// never a part, and an error leaves what was there. Temporary files of this file that killed writers left are removed.
///
/// # Errors
/// [`Error::Output`] with the system's reason.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), Error> {
    dynident_system::write_whole(path, contents).map_err(|source| Error::Output { path: path.to_owned(), source })
}

/// Tests before a long job whether [`write_whole`] can write into `folder`, which need not exist yet. Leaves nothing.
///
/// # Errors
/// [`Error::Output`] with the system's reason.
pub fn check_writable(folder: &Path) -> Result<(), Error> {
    dynident_system::check_writable(folder).map_err(|source| Error::Output { path: folder.to_owned(), source })
}
