//! Files appear whole or not at all.

use crate::error::Error;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes `contents` to `path` by way of a temporary file in the same folder: a reader sees the old file or the new
/// one, never a half of one, and an error leaves what was there.
///
/// # Errors
/// [`Error::Output`] with the system's reason.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), Error> {
    let cannot = |source| Error::Output { path: path.to_owned(), source };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(cannot)?;
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(cannot)?;
    file.write_all(contents).map_err(cannot)?;
    file.as_file().sync_all().map_err(cannot)?;
    // A temporary file is private to its owner; a result is for everybody whom the folder lets in.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644)).map_err(cannot)?;
    }
    file.persist(path).map_err(|error| cannot(error.error))?;
    Ok(())
}

/// Finds out before a long job whether [`write_whole`] will be able to write into `folder`, which need not exist yet.
/// Leaves nothing behind.
///
/// # Errors
/// [`Error::Output`] with the system's reason.
pub fn check_writable(folder: &Path) -> Result<(), Error> {
    let cannot = |source| Error::Output { path: folder.to_owned(), source };
    let nearest = folder.ancestors().find(|ancestor| ancestor.exists() || ancestor.as_os_str().is_empty());
    let nearest = nearest.filter(|ancestor| !ancestor.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::NamedTempFile::new_in(nearest).map(drop).map_err(cannot)
}

/// [`check_writable`], and that no file of these names in `folder` is one of the `inputs` of the job, under whatever
/// path and through whatever links: what a job reads it does not write over.
///
/// # Errors
/// [`Error::Output`] with the system's reason, [`Error::OverInput`].
pub fn check_outputs(folder: &Path, names: &[&str], inputs: &[PathBuf]) -> Result<(), Error> {
    check_writable(folder)?;
    let read: Vec<PathBuf> = inputs.iter().filter_map(|input| input.canonicalize().ok()).collect();
    let over = names.iter().map(|name| folder.join(name)).find(|path| {
        let there = path.canonicalize();
        there.is_ok_and(|there| read.contains(&there))
    });
    over.map_or(Ok(()), |path| Err(Error::OverInput { path }))
}
