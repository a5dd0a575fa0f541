//! Bounded reading of result files.

use crate::error::ResultFileError;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Largest file that can be read (result, design, iteration or factors), bytes.
pub const MAX_RESULT_BYTES: u64 = 1 << 32;

/// Reads an output file of a command: a result, a design, an iteration or factors.
///
/// # Errors
/// [`ResultFileError::File`] if the file cannot be read, is not a regular file, or is larger than [`MAX_RESULT_BYTES`].
pub fn read_result(path: &Path) -> Result<Vec<u8>, ResultFileError> {
    let cannot = |source| ResultFileError::File { path: path.to_owned(), source };
    dynident_files::read(path, MAX_RESULT_BYTES).map_err(cannot)
}

/// Parses the keys of `T` from the text of a result; other keys are ignored.
pub(crate) fn parsed<T: DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<T, ResultFileError> {
    serde_json::from_slice(bytes).map_err(|error| {
        let (line, column) = (error.line(), error.column());
        let message = format!("line {line}, column {column}: not a result of `identify`: {error}");
        ResultFileError::Content { path: path.to_owned(), message }
    })
}

/// Name of the schema in the text of a result.
pub(crate) fn schema_of(bytes: &[u8], path: &Path) -> Result<String, ResultFileError> {
    #[derive(Deserialize)]
    struct Schema {
        schema: String,
    }
    Ok(parsed::<Schema>(bytes, path)?.schema)
}
