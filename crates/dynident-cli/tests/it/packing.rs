//! Files for packages: shell completions and manual pages.

use super::common::{repository, run_in};
use std::path::Path;
use std::process::{Command, Stdio};

fn listed() -> Vec<String> {
    let help = run_in(Path::new("."), &["--help"]).stdout;
    let commands = help.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    // Descriptions continue with more indentation.
    let lines = commands.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    lines.map(|line| line.split_whitespace().next().unwrap().to_owned()).filter(|name| name != "help").collect()
}

#[allow(clippy::print_stdout, reason = "a test says that it was skipped")]
fn shell(name: &str) -> Option<Command> {
    let there = Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    if !there {
        println!("skipped: there is no `{name}`");
    }
    there.then(|| Command::new(name))
}

#[test]
fn shells_read_their_completions() {
    for name in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let ran = run_in(Path::new("."), &["completions", name]);
        assert_eq!((ran.status, ran.stderr.as_str()), (0, ""), "{name}");
        for command in listed() {
            assert!(ran.stdout.contains(&command), "{name}: {command}");
        }
        let Some(mut program) = matches!(name, "bash" | "zsh" | "fish").then(|| shell(name)).flatten() else {
            continue;
        };
        let mut reading = program.arg("-n").stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::io::Write::write_all(&mut reading.stdin.take().unwrap(), ran.stdout.as_bytes()).unwrap();
        let read = reading.wait_with_output().unwrap();
        assert!(read.status.success() && read.stderr.is_empty(), "{name}: {}", String::from_utf8_lossy(&read.stderr));
    }
    let refused = run_in(Path::new("."), &["completions", "bash", "--json"]);
    assert_eq!((refused.status, refused.stdout.as_str()), (2, ""));
    assert!(refused.stderr.contains("omit --json"));
    assert_eq!(run_in(Path::new("."), &["completions", "tcsh"]).status, 2);
}

#[test]
fn bash_completes() {
    let Some(mut bash) = shell("bash") else { return };
    let script = run_in(Path::new("."), &["completions", "bash"]).stdout;
    let ask = "\nCOMP_WORDS=(dynident export result.json --to ma)\nCOMP_CWORD=4\n_dynident dynident ma --to\n\
               printf '%s\\n' \"${COMPREPLY[@]}\"\n";
    let output = bash.args(["--norc", "-c", &(script + ask)]).output().unwrap();
    assert_eq!(
        String::from_utf8(output.stdout).unwrap().trim(),
        "matlab",
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run_in(folder.path(), &["man", "share/man1"]);
    assert_eq!((ran.status, ran.stdout.as_str(), ran.stderr.as_str()), (0, "", ""));
    let mut expected: Vec<String> = listed().iter().map(|name| format!("dynident-{name}.1")).collect();
    assert!(expected.len() > 10);
    expected.push("dynident.1".to_owned());
    expected.sort();
    let pages = std::fs::read_dir(folder.path().join("share/man1")).unwrap();
    let mut found: Vec<String> = pages.map(|page| page.unwrap().file_name().into_string().unwrap()).collect();
    found.sort();
    assert_eq!(found, expected);
    for name in &found {
        let text = std::fs::read_to_string(folder.path().join("share/man1").join(name)).unwrap();
        let about = name.trim_end_matches(".1");
        assert!(text.contains(&format!(".TH {about} 1")) && text.contains(".SH SYNOPSIS"), "{name}: {text}");
        // Global options are on every page.
        assert!(text.contains("\\-\\-threads"), "{name}");
    }
    assert_eq!(run_in(folder.path(), &["man", "share/man1/dynident.1"]).status, 2);
}

#[test]
fn the_citation_is_of_this_version() {
    let citation = std::fs::read_to_string(repository("CITATION.cff")).unwrap();
    let version = citation.lines().find_map(|line| line.strip_prefix("version: "));
    assert_eq!(version, Some(env!("CARGO_PKG_VERSION")));
}
