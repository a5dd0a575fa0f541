//! Faults of the operating system: a clock that is not set, folders and files that cannot be closed, a kill during
//! writing. They are injected by a small C library, which is loaded before that of the system.
#![cfg(target_os = "linux")]

use crate::common::{command, repository, run_in};
use crate::contract::json;
use crate::{factors, robots_outside};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The library; `None`, with a message, without a compiler.
#[allow(clippy::print_stdout, reason = "a test that is skipped says so")]
fn library(folder: &Path) -> Option<PathBuf> {
    let library = folder.join("faults.so");
    let source = repository("crates/dynident-cli/tests/faults.c");
    let compiled = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl").output();
    match compiled {
        Ok(output) => {
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            Some(library)
        }
        Err(error) => {
            println!("skipped: the C compiler `cc` cannot be started ({error})");
            None
        }
    }
}

/// Runs the command with a fault; status -1 for death by a signal.
fn with_fault(library: &Path, fault: &str, folder: &Path, arguments: &[&str]) -> (i32, String) {
    let mut command = command(folder, arguments);
    let output = command.env("LD_PRELOAD", library).env("DYNIDENT_FAULT", fault).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!said.contains("panicked"), "{fault}, {arguments:?}: {said}");
    (output.status.code().unwrap_or(-1), said)
}

/// Temporary files and folders next to the outputs.
fn leftovers(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with('.')).collect()
}

/// The result of a long job is written for any clock and any error when closing folders.
#[test]
fn no_command_panics_for_clocks_and_folders() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let Some(library) = library(folder) else { return };
    let study = factors::study(folder);
    std::fs::create_dir(folder.join("outside")).unwrap();
    robots_outside::robot(&folder.join("outside"), "exit 0");
    let iteration = robots_outside::study(&folder.join("outside"), "").display().to_string();
    let mut made_at = Vec::new();
    for fault in ["none", "year-1811", "year-36812", "closedir", "close"] {
        let run = |arguments: &[&str]| {
            let (status, said) = with_fault(&library, fault, folder, arguments);
            assert!(status == 0 || status == 1, "{fault}, {arguments:?}: {said}");
        };
        // The first of the two lists the folder for leftovers.
        run(&["identify", &study, "--out", "result", "--quiet"]);
        run(&["reduce", &study, "--out", "a.factors", "--quiet"]);
        run(&["identify", "--factors", "a.factors", "--out", "of_factors", "--quiet"]);
        run(&["export", "result/result.json", "--study", &study, "--to", "c", "--out", "arm.h"]);
        run(&["iterate", &iteration, "--out", "iteration", "--allow-command", "--quiet"]);
        run(&["iterate", &iteration, "--out", "iteration", "--allow-command", "--quiet", "--fresh"]);
        for result in ["result", "of_factors"] {
            let result = json(&std::fs::read_to_string(folder.join(result).join("result.json")).unwrap());
            made_at.push(result["timings_s"]["made_at"].as_str().unwrap().to_owned());
        }
        for written in ["", "result", "of_factors", "iteration", "iteration/runs"] {
            assert_eq!(leftovers(&folder.join(written)), [""; 0], "{fault}: {written}");
        }
    }
    let is_unknown: Vec<bool> = made_at.iter().map(|at| at.starts_with("unknown")).collect();
    assert_eq!(is_unknown, [false, false, true, true, true, true, false, false, false, false], "{made_at:?}");
}

/// A disk that cannot write is an error of the command, and existing files are unchanged.
#[test]
fn a_disk_that_fails_is_an_error() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let Some(library) = library(folder) else { return };
    let study = factors::study(folder);
    assert_eq!(run_in(folder, &["reduce", &study, "--out", "a.factors"]).status, 0);
    let before = std::fs::read(folder.join("a.factors")).unwrap();
    let (status, said) = with_fault(&library, "fsync", folder, &["reduce", &study, "--out", "a.factors"]);
    assert_eq!(status, 2, "{said}");
    assert!(said.contains("a.factors: cannot be written"), "{said}");
    assert_eq!(std::fs::read(folder.join("a.factors")).unwrap(), before);
    assert_eq!(leftovers(folder), [""; 0]);
}

/// After a kill between writing and renaming, the next run with the same output removes the temporary files, and
/// nothing else.
#[test]
fn the_next_run_removes_the_temporary_files_of_a_killed_one() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    let Some(library) = library(folder) else { return };
    let study = factors::study(folder);
    let status = run_in(folder, &["identify", &study, "--out", "result", "--quiet"]).status;
    assert!(status == 0 || status == 1);
    let arm = crate::common::broken().join("arm.urdf").display().to_string();
    std::fs::write(folder.join("states.csv"), "q1,q2\n0.1,0.2\n").unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["reduce", &study, "--out", "a.factors"], ""),
        (&["merge", "b.factors", "--out", "a.factors"], ""),
        (&["export", "result/result.json", "--study", &study, "--to", "c", "--out", "exported/arm.h"], "exported"),
        (&["evaluate", &arm, "--states", "states.csv", "--quantity", "gravity", "--out", "gravity.csv"], ""),
        (&["new", "--robot", &arm, "--log", "honest.csv", "--out", "new.toml", "--force"], ""),
        (&["man", "manual"], "manual"),
    ];
    assert_eq!(run_in(folder, &["reduce", &study, "--out", "b.factors"]).status, 0);
    for (arguments, written) in cases {
        let written = folder.join(written);
        for _ in 0..2 {
            let (status, said) = with_fault(&library, "kill", folder, arguments);
            assert_eq!(status, -1, "{arguments:?}: {said}");
            // The second killed run has removed the leftovers of the first.
            let own = leftovers(&written).into_iter().filter(|name| name.contains(".dynident-"));
            assert_eq!(own.count(), 1, "{arguments:?}");
        }
        std::fs::write(written.join(".tmpAbCdEf"), "of another program").unwrap();
        let outcome = run_in(folder, arguments);
        assert!(outcome.status == 0 || outcome.status == 1, "{arguments:?}: {}", outcome.stderr);
        assert_eq!(leftovers(&written), [".tmpAbCdEf"], "{arguments:?}");
    }
}
