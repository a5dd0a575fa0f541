//! The first steps: the example of `init`, schemas, the version, wrong kinds of files, and default folders.

use super::common::{broken, repository, run_in};
use super::contract::json;
use std::path::Path;

#[test]
fn the_example_is_complete_and_never_overwrites() {
    let folder = tempfile::tempdir().unwrap();
    let made = run_in(folder.path(), &["init"]);
    assert_eq!((made.status, &*made.stderr), (0, ""), "{}", made.stdout);
    assert!(made.stdout.contains("dynident check dynident-example/study.toml"), "{}", made.stdout);
    // Check finds nothing to correct, and identify needs no further option.
    let checked = run_in(folder.path(), &["check", "dynident-example/study.toml", "--json"]);
    assert_eq!(checked.status, 0, "{}{}", checked.stdout, checked.stderr);
    let identified =
        run_in(folder.path(), &["identify", "dynident-example/study.toml", "--max-validation-error", "1.2"]);
    assert_eq!(identified.status, 0, "{}{}", identified.stdout, identified.stderr);
    for name in ["result.json", "report.html", "identified.urdf"] {
        assert!(folder.path().join("study-result").join(name).is_file(), "{name}");
    }
    // A result is named by its folder, too.
    let validated = run_in(folder.path(), &["validate", "study-result", "--study", "dynident-example/study.toml"]);
    assert_eq!(validated.status, 0, "{}{}", validated.stdout, validated.stderr);
    let file = folder.path().join("dynident-example/train.csv");
    std::fs::write(&file, "mine").unwrap();
    let again = run_in(folder.path(), &["init"]);
    assert_eq!(again.status, 2);
    assert!(again.stderr.contains("exists already and is not overwritten: name another folder"), "{}", again.stderr);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    let shown = run_in(folder.path(), &["init", "other", "--json"]);
    assert_eq!(json(&shown.stdout)["files"][3], "study.toml", "{}", shown.stdout);
}

#[test]
fn schemas_are_those_of_the_repository() {
    let folder = Path::new(".");
    let listed = run_in(folder, &["schema"]).stdout;
    for name in ["study", "result", "design"] {
        assert!(listed.lines().any(|line| line == name), "{listed}");
    }
    let study = run_in(folder, &["schema", "study"]);
    let file = std::fs::read_to_string(repository("docs/schemas/study.json")).unwrap();
    assert_eq!((study.status, json(&study.stdout)), (0, json(&file)));
    assert_eq!(run_in(folder, &["schema", "study.json"]).stdout, study.stdout);
    let unknown = run_in(folder, &["schema", "stuyd"]);
    assert_eq!(unknown.status, 2);
    assert!(unknown.stderr.contains("no schema `stuyd`; the schemas are: benchmark, "), "{}", unknown.stderr);
}

#[test]
fn the_version_has_details() {
    let short = run_in(Path::new("."), &["--version"]).stdout;
    for arguments in [["--version", "--verbose"], ["--verbose", "-V"]] {
        let long = run_in(Path::new("."), &arguments);
        assert_eq!(long.status, 0, "{}", long.stderr);
        assert!(long.stdout.starts_with(&short), "{}", long.stdout);
        for word in ["commit: ", "instructions: ", "threads: ", "robot files: URDF, MJCF", "log files: text"] {
            assert!(long.stdout.contains(word), "{word}: {}", long.stdout);
        }
    }
}

#[test]
fn other_files_in_place_of_a_study_get_the_right_command() {
    let folder = tempfile::tempdir().unwrap();
    let written = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    written("log.csv", "t,q1,q2,tau1,tau2\n0,1,2,3,4\n");
    written("result.json", "{\"schema\": \"dynident/result/1\"}");
    std::fs::copy(broken().join("arm.urdf"), folder.path().join("arm.urdf")).unwrap();
    for (file, words) in [
        (
            "arm.urdf",
            "this is a robot description, not a study: write a study for it: dynident new --robot arm.urdf --log LOG",
        ),
        ("log.csv", "this is a table, not a study: write a study for it: dynident new --robot ROBOT --log log.csv"),
        ("result.json", "this is a JSON file, not a study: give the study file"),
    ] {
        for command in [&["check", file][..], &["identify", file, "--out", "out"]] {
            let ran = run_in(folder.path(), command);
            assert_eq!(ran.status, 2);
            assert!(ran.stderr.contains(words), "{}", ran.stderr);
        }
    }
}
