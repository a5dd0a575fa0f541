//! Helpers for the tests of several crates: paths of files, number of repetitions of an experiment, and comparison with
//! a JSON schema, and simulated logs with events.

#![forbid(unsafe_code)]

pub mod event_logs;
pub mod schema;

use std::path::{Path, PathBuf};

/// A file or folder of the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// The folder of the public recordings, which are not in the repository: `DYNIDENT_DATA`, or `../shared/data` relative
/// to the repository. Prints a note and returns `None` if it does not exist.
pub fn recordings() -> Option<PathBuf> {
    let folder = std::env::var_os("DYNIDENT_DATA").map_or_else(|| repository("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    #[allow(clippy::print_stdout, reason = "a skipped test says so")]
    {
        println!("SKIPPED: no recordings in {} (set DYNIDENT_DATA)", folder.display());
    }
    None
}

/// Number of repetitions of a random experiment: `daily`, or `long` if `DYNIDENT_LONG` is 1. The long run continues the
/// daily one with the same seed.
///
/// # Panics
/// If `DYNIDENT_LONG` is neither 0 nor 1, because a long run must not be skipped silently.
pub fn count(daily: usize, long: usize) -> usize {
    match std::env::var("DYNIDENT_LONG").as_deref() {
        Ok("1") => long,
        Ok("0") | Err(_) => daily,
        Ok(other) => panic!("DYNIDENT_LONG = {other}; set it to 0 or 1"),
    }
}
