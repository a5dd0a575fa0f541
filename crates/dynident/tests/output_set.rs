//! Killed at any moment or with a full disk, an output folder contains one complete set: the old one or the new one.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
#![cfg(unix)]

use dynident::model::sample::Random;
use dynident::{Error, OutputSet};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const FOLDER: &str = "DYNIDENT_TEST_OUTPUTS";
/// All but one of these files are in every set; the missing one changes from set to set.
const NAMES: [&str; 4] = ["result.json", "report.html", "identified.urdf", "study/arm.toml"];

/// Set number `k`; its files contain the number and have `long` bytes.
fn set(folder: &Path, k: usize, long: usize) -> OutputSet {
    let mut set = OutputSet::new(folder);
    for (place, name) in NAMES.iter().enumerate() {
        let is_absent = k.is_multiple_of(3) && place == 2;
        set = if is_absent { set.absent(name) } else { set.file(name, format!("{k} {}", "x".repeat(long))) };
    }
    set
}

/// Number of the set in the folder; `None` if there is none. Fails on a mixture of two sets.
fn found(folder: &Path) -> Option<usize> {
    let number = |name: &str| -> Option<usize> {
        let text = std::fs::read_to_string(folder.join(name)).ok()?;
        Some(text.split(' ').next().unwrap().parse().unwrap())
    };
    let all: Vec<Option<usize>> = NAMES.iter().map(|name| number(name)).collect();
    let expected = |place: usize| all[0].filter(|k| !(k.is_multiple_of(3) && place == 2));
    for place in 0..NAMES.len() {
        assert_eq!(all[place], expected(place), "{all:?}");
    }
    all[0]
}

/// The killed process: this program with this test alone, which writes sets repeatedly.
#[test]
#[ignore = "the child of the tests below"]
fn child() {
    let Ok(folder) = std::env::var(FOLDER) else { return };
    let folder = Path::new(&folder);
    let from = found(folder).map_or(1, |k| k + 1);
    // The number of sets can be one, to test faults.
    let sets = std::env::var("DYNIDENT_TEST_SETS").map_or(100_000, |sets| sets.parse().unwrap());
    for k in from..from + sets {
        set(folder, k, 3000).write().unwrap();
    }
}

fn spawned(folder: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child", "--ignored"])
        .env(FOLDER, folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

#[test]
fn killed_at_any_moment_one_whole_set_is_there() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("notes.txt"), "the user's own").unwrap();
    let mut random = Random::new(7);
    let (mut last, mut interrupted) = (0, 0);
    for _ in 0..dynident_testing::count(50, 1000) {
        let mut running = spawned(folder.path());
        // The program starts in a few ms; a set takes about as long.
        std::thread::sleep(Duration::from_secs_f64(random.uniform(0.005, 0.06)));
        running.kill().unwrap();
        running.wait().unwrap();
        let number = found(folder.path()).unwrap_or(0);
        assert!(number >= last, "set {number} after set {last}");
        last = number;
        interrupted += usize::from(stages(folder.path()) > 0);
    }
    assert!(last > 0 && interrupted > 0, "no kill fell into the writing: {last} sets, {interrupted} interrupted");
    // The next set cleans up: files replace links, the user's link is kept.
    set(folder.path(), last + 1, 10).write().unwrap();
    assert_eq!((found(folder.path()), stages(folder.path())), (Some(last + 1), 0));
    assert!(NAMES.iter().all(|name| !folder.path().join(name).is_symlink()));
    assert_eq!(std::fs::read_to_string(folder.path().join("notes.txt")).unwrap(), "the user's own");
    println!("{last} sets written, {interrupted} kills in the middle of one");
}

/// A stage prepared by an attacker in `folder`: it moves `name` from its new files to its place.
fn prepared_stage(folder: &Path, name: &str) -> PathBuf {
    let stage = folder.join(".dynident-set-abcdef");
    std::fs::create_dir_all(stage.join("new")).unwrap();
    std::fs::write(stage.join("names"), name).unwrap();
    std::fs::write(stage.join("decided"), "").unwrap();
    stage
}

/// Checks that the next set is written and that the outside file remains.
fn assert_next_set_keeps_outside(folder: &Path, outside: &Path) {
    set(folder, 1, 10).write().unwrap();
    assert_eq!(found(folder), Some(1));
    assert_eq!(std::fs::read_to_string(outside.join("key")).unwrap(), "own");
}

#[test]
fn a_prepared_stage_moves_no_files_outside_of_its_folder() {
    use std::os::unix::fs::symlink;
    let root = tempfile::tempdir().unwrap();
    let outside = root.path().join("outside");
    std::fs::create_dir(&outside).unwrap();
    std::fs::write(outside.join("key"), "own").unwrap();
    let output = |name: &str| {
        let folder = root.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        folder
    };
    // A parent folder of the file's place is a link: the file would be overwritten.
    let folder = output("place");
    symlink(&outside, folder.join("link")).unwrap();
    let stage = prepared_stage(&folder, "link/key");
    std::fs::create_dir(stage.join("new/link")).unwrap();
    std::fs::write(stage.join("new/link/key"), "foreign").unwrap();
    assert_next_set_keeps_outside(&folder, &outside);
    // The folder of new files, or one below it, is a link: the file would be moved.
    let folder = output("new");
    let stage = prepared_stage(&folder, "key");
    std::fs::remove_dir(stage.join("new")).unwrap();
    symlink(&outside, stage.join("new")).unwrap();
    assert_next_set_keeps_outside(&folder, &outside);
    let folder = output("below");
    let stage = prepared_stage(&folder, "link/key");
    std::fs::create_dir(folder.join("link")).unwrap();
    symlink(&outside, stage.join("new/link")).unwrap();
    assert_next_set_keeps_outside(&folder, &outside);
    // The stage itself is a link.
    let folder = output("stage");
    let stage = prepared_stage(root.path(), "new/key");
    std::fs::create_dir(stage.join("new/new")).unwrap();
    std::fs::write(stage.join("new/new/key"), "own").unwrap();
    symlink(&stage, folder.join(".dynident-set-abcdef")).unwrap();
    assert_next_set_keeps_outside(&folder, &stage.join("new/new"));
}

#[test]
fn a_stage_with_a_pipe_for_its_names_does_not_block() {
    let folder = tempfile::tempdir().unwrap();
    let stage = prepared_stage(folder.path(), "");
    std::fs::remove_file(stage.join("names")).unwrap();
    assert!(Command::new("mkfifo").arg(stage.join("names")).status().unwrap().success());
    set(folder.path(), 1, 10).write().unwrap();
    assert_eq!((found(folder.path()), stages(folder.path())), (Some(1), 0));
}

fn stages(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).unwrap().flatten();
    entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(".dynident-set-")).count()
}

/// Child process on a separate small file system: it fills all but `free` KiB and writes.
#[test]
#[ignore = "the child of the test below"]
fn child_on_a_full_disk() {
    let Ok(folder) = std::env::var(FOLDER) else { return };
    let folder = Path::new(&folder);
    set(folder, 1, 3000).write().unwrap();
    // One page at a time until the set fits, which covers all possible failure points.
    let ballast = |page: usize| folder.join(format!("ballast-{page}"));
    let mut pages = 0;
    while std::fs::write(ballast(pages), [1_u8; 4096]).is_ok() {
        pages += 1;
    }
    for (failures, page) in (0..=pages).rev().enumerate() {
        // The last file may have failed before it was created.
        let _ = std::fs::remove_file(ballast(page));
        let Err(error) = set(folder, 2, 9000).write() else {
            assert_eq!((found(folder), stages(folder)), (Some(2), 0));
            println!("full {failures} times");
            return;
        };
        assert!(matches!(error, Error::Output { .. }), "{error}");
        assert!(error.to_string().contains("existing files are unchanged"), "{error}");
        assert_eq!((found(folder), stages(folder)), (Some(1), 0), "{error}");
    }
    panic!("the set never fitted");
}

/// Needs a separate file system in a user namespace, which is not available on every system.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_leaves_the_old_set() {
    for limit in ["size=200k", "size=10m,nr_inodes=60"] {
        let folder = tempfile::tempdir().unwrap();
        let script =
            format!("mount -t tmpfs -o {limit} none \"$DYNIDENT_TEST_OUTPUTS\" || exit 77; exec \"$0\" \"$@\"");
        let ran = Command::new("unshare")
            .args(["--user", "--map-root-user", "--mount", "sh", "-c", &script])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "child_on_a_full_disk", "--ignored", "--nocapture"])
            .env(FOLDER, folder.path())
            .output();
        let Ok(ran) = ran else {
            println!("skipped: there is no unshare(1)");
            return;
        };
        let out = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
        if ran.status.code() == Some(77) || out.contains("unshare") {
            println!("skipped: no separate file system: {out}");
            return;
        }
        assert!(ran.status.success(), "{out}");
        assert!(out.contains("full ") && !out.contains("full 0 times"), "{out}");
    }
}

#[test]
fn what_is_in_the_way_is_named_and_nothing_changes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    set(path, 1, 10).write().unwrap();
    std::fs::remove_file(path.join("report.html")).unwrap();
    std::fs::create_dir(path.join("report.html")).unwrap();
    let error = set(path, 2, 10).write().unwrap_err().to_string();
    assert!(error.contains("report.html") && error.contains("folder"), "{error}");
    assert!(std::fs::read_to_string(path.join("result.json")).unwrap().starts_with("1 "));
    assert_eq!(stages(path), 0);
}

#[test]
fn a_link_of_the_users_own_gives_way_and_its_target_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::create_dir(path.join("out")).unwrap();
    std::fs::write(path.join("elsewhere"), "mine").unwrap();
    std::os::unix::fs::symlink("../elsewhere", path.join("out/result.json")).unwrap();
    set(&path.join("out"), 1, 10).write().unwrap();
    assert_eq!(found(&path.join("out")), Some(1));
    assert_eq!(std::fs::read_to_string(path.join("elsewhere")).unwrap(), "mine");
}

#[test]
fn two_programs_at_once_leave_the_set_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let writers = (1..=4).map(|k| {
        let path = folder.path().to_owned();
        std::thread::spawn(move || (0..5).for_each(|again| set(&path, 10 * again + k, 100).write().unwrap()))
    });
    let writers: Vec<_> = writers.collect();
    for writer in writers {
        writer.join().unwrap();
    }
    assert!(found(folder.path()).is_some());
    assert_eq!(stages(folder.path()), 0);
}
