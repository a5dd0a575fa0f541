//! Programs that files from strangers need: started with permission only, within a time limit, and stopped with their
//! children. The program `xacro` is a shell script here.
#![cfg(unix)]

use crate::common::{CommandOutcome, broken, command};
use crate::contract::json;
use crate::robots_outside::{awaited, interrupt, runs};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// A good study with a robot file that has macros, and a program `xacro` that writes its arguments into `ran` and then
/// executes `rest`.
pub(crate) fn folder(rest: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["log.csv", "good.toml"] {
        std::fs::copy(broken().join(name), at.join(name)).unwrap();
    }
    let arm = std::fs::read_to_string(broken().join("arm.urdf")).unwrap();
    let declared = "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" ";
    let macros = arm.replacen("<robot ", declared, 1).replacen(
        "</robot>",
        "<xacro:property name=\"m\" value=\"${1}\"/></robot>",
        1,
    );
    assert!(macros.contains("${1}"));
    std::fs::write(at.join("arm.urdf"), macros).unwrap();
    std::fs::create_dir(at.join("bin")).unwrap();
    std::fs::write(at.join("bin/expanded.urdf"), arm).unwrap();
    let program = at.join("bin/xacro");
    std::fs::write(&program, format!("#!/bin/sh\nhere=$(dirname \"$0\")\necho \"$@\" >>\"$here/ran\"\n{rest}\n"))
        .unwrap();
    std::fs::set_permissions(program, std::fs::Permissions::from_mode(0o755)).unwrap();
    std::fs::write(at.join("states.csv"), "q1,q2\n0.1,0.2\n").unwrap();
    folder
}

pub(crate) const EXPANDS: &str = "cat \"$here/expanded.urdf\"";

pub(crate) fn with_xacro(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = command(folder, arguments);
    command.env("PATH", format!("{}:{}", folder.join("bin").display(), std::env::var("PATH").unwrap()));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run_in(folder: &Path, arguments: &[&str]) -> CommandOutcome {
    let output = with_xacro(folder, arguments).output().unwrap();
    CommandOutcome {
        status: output.status.code().unwrap_or(-1),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// The arguments with which the script was started, one line per start.
pub(crate) fn starts(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("bin/ran")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// For every command that reads a robot file: without permission no program runs, nothing is written, and the message
/// contains the file, the option and the command to run by hand.
#[test]
fn no_command_expands_macros_without_permission() {
    let folder = folder(EXPANDS);
    let before = names(folder.path());
    let cases: [&[&str]; 13] = [
        &["inspect", "arm.urdf"],
        &["inspect", "arm.urdf", "--fix", "fixed.urdf"],
        &["new", "--robot", "arm.urdf", "--log", "log.csv", "--out", "new.toml"],
        &["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "gravity"],
        &["check", "good.toml"],
        &["identify", "good.toml", "--out", "out"],
        &["reduce", "good.toml", "--out", "a.factors"],
        &["validate", "result.json", "--study", "good.toml"],
        &["export", "result.json", "--study", "good.toml", "--to", "c"],
        &["design", "good.toml", "--out", "out"],
        &["design", "good.toml", "--check-log", "log", "--out", "out"],
        &["simulate", "good.toml", "--out", "out"],
        &["iterate", "good.toml", "--out", "out"],
    ];
    for arguments in cases {
        let outcome = run_in(folder.path(), arguments);
        let said = &outcome.stderr;
        assert_eq!(outcome.status, 2, "{arguments:?}: {said}");
        for part in ["arm.urdf: ", "--allow-command", "\n  xacro arm.urdf > arm.expanded.urdf"] {
            assert!(said.contains(part), "{arguments:?}: {said}");
        }
        assert_eq!(starts(folder.path()), [""; 0], "{arguments:?}");
        assert_eq!(names(folder.path()), before, "{arguments:?}");
    }
}

/// With permission xacro runs once per command, the command is shown, and it receives the arguments from the command
/// line, and from the study that `new` writes.
#[test]
fn permitted_macros_are_expanded_once_with_their_arguments() {
    let folder = folder(EXPANDS);
    let at = folder.path();
    let plain = run_in(&broken(), &["inspect", "arm.urdf", "--json"]);
    let outcome = run_in(at, &["inspect", "arm.urdf", "--json", "--allow-command"]);
    assert_eq!(outcome.status, plain.status, "{}", outcome.stderr);
    assert_eq!(json(&outcome.stdout), json(&plain.stdout));
    assert!(outcome.stderr.contains("note: starting the program that expands the robot file: xacro arm.urdf\n"));
    assert_eq!(starts(at), ["arm.urdf"]);

    let arguments = ["--xacro", "ur_type=ur5e", "--xacro", "note:=a b", "--xacro-limit-s", "20", "--allow-command"];
    let new = ["new", "--robot", "arm.urdf", "--log", "log.csv", "--out", "new.toml"];
    let outcome = run_in(at, &[&new[..], &arguments].concat());
    assert!(outcome.status == 0 || outcome.status == 1, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("xacro arm.urdf 'note:=a b' ur_type:=ur5e\n"), "{}", outcome.stderr);
    assert_eq!(starts(at)[1..], ["arm.urdf note:=a b ur_type:=ur5e"]);
    let study = std::fs::read_to_string(at.join("new.toml")).unwrap();
    assert!(study.contains("\nxacro = { note = \"a b\", ur_type = \"ur5e\" }\n"), "{study}");
    assert!(study.contains("\nxacro_limit_s = 20.0\n"), "{study}");

    let outcome = run_in(at, &["check", "new.toml", "--allow-command"]);
    assert!(outcome.status == 0 || outcome.status == 1, "{}", outcome.stderr);
    assert_eq!(starts(at)[2..], ["arm.urdf note:=a b ur_type:=ur5e"]);
    let plain = run_in(
        &broken(),
        &["evaluate", "arm.urdf", "--states", &at.join("states.csv").display().to_string(), "--quantity", "gravity"],
    );
    let outcome =
        run_in(at, &["evaluate", "arm.urdf", "--states", "states.csv", "--quantity", "gravity", "--allow-command"]);
    assert_eq!((outcome.status, outcome.stdout), (0, plain.stdout), "{}", outcome.stderr);
}

#[test]
fn xacro_arguments_are_checked() {
    let folder = folder(EXPANDS);
    let at = folder.path();
    std::fs::copy(broken().join("arm.urdf"), at.join("plain.urdf")).unwrap();
    let cases: [(&[&str], &str); 4] = [
        (&["inspect", "plain.urdf", "--xacro", "a=1"], "no xacro macros"),
        (&["inspect", "arm.urdf", "--xacro=--output=x"], "invalid xacro argument"),
        (&["inspect", "arm.urdf", "--xacro", "a"], "KEY=VALUE"),
        (&["inspect", "arm.urdf", "--xacro-limit-s", "0"], "xacro_limit_s"),
    ];
    for (arguments, part) in cases {
        let outcome = run_in(at, &[arguments, &["--allow-command"]].concat());
        assert_eq!(outcome.status, 2, "{arguments:?}");
        assert!(outcome.stderr.contains(part), "{arguments:?}: {}", outcome.stderr);
    }
    let good = std::fs::read_to_string(at.join("good.toml")).unwrap();
    let study = good.replace("[robot]\n", "[robot]\nxacro = { \"-o\" = \"x\" }\n");
    std::fs::write(at.join("options.toml"), study).unwrap();
    let outcome = run_in(at, &["check", "options.toml", "--allow-command"]);
    assert!(outcome.status == 2 && outcome.stderr.contains("robot: invalid xacro argument `-o`"), "{}", outcome.stderr);
    assert_eq!(starts(at), [""; 0]);
}

/// A failure is reported with the program's message, without control characters.
#[test]
fn a_failure_of_xacro_is_reported() {
    let folder = folder("printf 'no such \\033[31mpackage' >&2; exit 3");
    let outcome = run_in(folder.path(), &["check", "good.toml", "--allow-command"]);
    assert_eq!(outcome.status, 2);
    for part in ["good.toml: arm.urdf: ", "(exit status: 3)", "no such \\u001b[31mpackage"] {
        assert!(outcome.stderr.contains(part), "{}", outcome.stderr);
    }
    assert!(outcome.stderr.contains("correct the file or the arguments"), "{}", outcome.stderr);
    let without_ros = self::folder("echo \"No module named 'ament_index_python'\" >&2; exit 2");
    let outcome = run_in(without_ros.path(), &["inspect", "arm.urdf", "--allow-command"]);
    for part in ["ament_index_python", "source the setup of your workspace", "robot_description > robot.urdf"] {
        assert!(outcome.stderr.contains(part), "{}", outcome.stderr);
    }
    let mut missing = with_xacro(folder.path(), &["inspect", "arm.urdf", "--allow-command"]);
    let output = missing.env("PATH", folder.path().join("nowhere")).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && said.contains("not installed"), "{said}");
}

/// A program that does not end is stopped by its time limit and by Ctrl-C, together with its children.
#[test]
fn a_hanging_xacro_is_stopped_with_its_children() {
    let folder = folder("sleep 600 & echo $! >\"$here/pid\"; mv \"$here/pid\" \"$here/child\"; wait");
    let child = folder.path().join("bin/child");
    let outcome = run_in(folder.path(), &["inspect", "arm.urdf", "--allow-command", "--xacro-limit-s", "1.5"]);
    assert_eq!(outcome.status, 2);
    assert!(outcome.stderr.contains("did not end within 1.5 s and was stopped"), "{}", outcome.stderr);
    assert!(!runs(&child));

    std::fs::remove_file(&child).unwrap();
    let mut program = with_xacro(folder.path(), &["inspect", "arm.urdf", "--allow-command"]).spawn().unwrap();
    awaited(&child, &mut program);
    interrupt(&program);
    assert_eq!(program.wait_with_output().unwrap().status.code(), Some(130));
    assert!(!runs(&child));
}
