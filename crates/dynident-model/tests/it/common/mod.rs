//! Where the tests find robots and recordings, and a small arm.

#![allow(clippy::print_stdout, reason = "a skipped test says so")]

use std::path::{Path, PathBuf};

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The robot descriptions: in the workspace, else beside it; `None`, said plainly, where there are none.
pub(crate) fn robots_dir() -> Option<PathBuf> {
    let found = [workspace().join("robots"), data_root().join("../robots")].into_iter().find(|path| path.is_dir());
    if found.is_none() {
        println!("skipped: no directory of robots");
    }
    found
}

/// The public recordings with their URDFs; `None`, said plainly, where there are none.
pub(crate) fn data_dir() -> Option<PathBuf> {
    let found = Some(data_root()).filter(|path| path.is_dir());
    if found.is_none() {
        println!("skipped: no recordings; set DYNIDENT_DATA");
    }
    found
}

fn data_root() -> PathBuf {
    std::env::var_os("DYNIDENT_DATA").map_or_else(|| workspace().join("../shared/data"), PathBuf::from)
}

/// All URDF files at hand outside the repository.
pub(crate) fn foreign_urdfs() -> Vec<PathBuf> {
    let mut directories: Vec<PathBuf> = robots_dir().into_iter().collect();
    if let Some(data) = data_dir() {
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

/// A clean arm of three joints (one prismatic), with a tool of two links fixed to the last, one of them without inertial.
pub(crate) const ARM: &str = include_str!("arm.urdf");
