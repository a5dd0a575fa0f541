//! The robot descriptions at hand, and a small arm.

use dynident_testing::{recordings, repository};
use std::path::PathBuf;

/// All URDF files at hand: of the repository, and beside the recordings.
pub(crate) fn foreign_urdfs() -> Vec<PathBuf> {
    let mut directories = vec![repository("robots")];
    if let Some(data) = recordings() {
        let entries = std::fs::read_dir(data).expect("data directory").filter_map(Result::ok);
        directories.extend(entries.map(|entry| entry.path()).filter(|path| path.is_dir()));
    }
    let mut files: Vec<PathBuf> = directories
        .iter()
        .flat_map(|directory| std::fs::read_dir(directory).expect("directory"))
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "urdf"))
        .collect();
    files.sort();
    files
}

/// A clean arm of three joints (one prismatic), with a tool of two links fixed to the last, one of them without
/// inertial.
pub(crate) const ARM: &str = include_str!("arm.urdf");
