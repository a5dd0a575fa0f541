//! Bounded reading of result files.

use crate::error::ResultFileError;
use std::path::Path;

/// Largest readable file of a result, a design, runs or factors, bytes.
pub const MAX_RESULT_BYTES: u64 = 1 << 32;

/// Reads an output file of a command: a result, a design, runs, factors.
///
/// # Errors
/// [`ResultFileError::File`] if the file cannot be read, is not a regular file, or is larger than [`MAX_RESULT_BYTES`].
pub fn read_result(path: &Path) -> Result<Vec<u8>, ResultFileError> {
    let cannot = |source| ResultFileError::File { path: path.to_owned(), source };
    dynident_files::read(path, MAX_RESULT_BYTES).map_err(cannot)
}
