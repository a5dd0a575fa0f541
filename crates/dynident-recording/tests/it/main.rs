//! Integration tests of this crate in one binary.
#![allow(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

mod broken_files;
mod cleaning;
mod memory;
mod real_logs;
mod sage;
mod scipy;
mod selection;
mod streaming;

/// A temporary file with these bytes.
fn file_with(bytes: impl AsRef<[u8]>) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    file
}
