//! Calls that the sources of all crates must not contain, except in the stated files.
use crate::common::repository;
use std::path::{Path, PathBuf};

/// The forbidden calls, the only files that may contain them, and the reason.
const ONLY_IN: [(&[&str], &[&str], &str); 4] = [
    (
        &["Command::new(", "process::Command", "process::{Child, Command", "CommandExt", ".spawn()"],
        &["dynident-system/src/programs/group.rs"],
        "a program is started with permission only: dynident_system::ProcessGroup",
    ),
    (
        &["read_dir(", "remove_dir_all("],
        &["dynident-system/src/folder.rs"],
        "the standard library panics if a folder cannot be closed: dynident_system::names, remove_folder",
    ),
    (
        &["NamedTempFile", "TempDir", "tempdir(", "tempdir_in(", "tempfile("],
        // The unnamed file of an unpacked recording disappears with the process.
        &[
            "dynident-system/src/temporary_folder.rs",
            "dynident-system/src/whole_file.rs",
            "dynident-formats/src/bags/unpacked.rs",
        ],
        "temporary files of a killed program must be removed: dynident_system::write_whole, TemporaryFolder",
    ),
    (
        &["format_rfc3339", "SystemTime::now"],
        &["dynident/src/clock.rs"],
        "the clock of the computer may be before 1970: crate::clock",
    ),
];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs") {
            found.push(path);
        }
    }
}

/// The lines of a source without comments and without its tests, which are at its end.
pub(crate) fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let is_test = |line: &&str| line.starts_with("#[cfg(test)]") || line.starts_with("#[cfg(all(test");
    let own = text.lines().take_while(move |line| !is_test(line)).enumerate();
    own.filter(|(_, line)| !line.trim_start().starts_with("//"))
}

/// All sources of all crates except the tests' own, with their paths from the folder `crates`.
pub(crate) fn all() -> Vec<(String, String)> {
    let crates = repository("crates");
    let mut files = Vec::new();
    for entry in std::fs::read_dir(&crates).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.ends_with("dynident-testing") {
            sources(&folder.join("src"), &mut files);
        }
    }
    let named = |path: &PathBuf| path.strip_prefix(&crates).unwrap().to_string_lossy().replace('\\', "/");
    files.iter().map(|path| (named(path), std::fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn programs_folders_and_clocks_are_used_in_one_place() {
    let files = all();
    assert!(files.len() > 300);
    for (calls, places, reason) in ONLY_IN {
        let mut seen = Vec::new();
        for (name, text) in &files {
            for (number, line) in code(text) {
                if calls.iter().any(|call| line.contains(call)) {
                    assert!(places.contains(&&name[..]), "{name}:{}: {line}\n{reason}", number + 1);
                    seen.push(name.clone());
                }
            }
        }
        // The search works: it finds the allowed calls.
        assert!(places.iter().all(|place| seen.iter().any(|name| name == place)), "{places:?}");
    }
}
