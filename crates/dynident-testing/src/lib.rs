//! What the tests of several crates share: where files are, how often an experiment is repeated, whether a file is
//! as its schema says. It knows no other crate.

#![forbid(unsafe_code)]

pub mod schema;

use std::path::{Path, PathBuf};

/// A file or folder of the repository.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// The folder of the public recordings, which the repository does not hold: `DYNIDENT_DATA`, else `../shared/data`
/// beside the repository; `None`, said plainly, where there is none.
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

/// How often a random experiment is repeated: `daily`, and `long` where `DYNIDENT_LONG` is 1. The long run goes on
/// where the daily one ends, with the same seed.
///
/// # Panics
/// Where `DYNIDENT_LONG` is set to anything but 0 or 1: a long run that quietly is none would prove nothing.
pub fn count(daily: usize, long: usize) -> usize {
    match std::env::var("DYNIDENT_LONG").as_deref() {
        Ok("1") => long,
        Ok("0") | Err(_) => daily,
        Ok(other) => panic!("DYNIDENT_LONG is 0 or 1, not {other}"),
    }
}
