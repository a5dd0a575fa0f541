//! Runs every target on a fixed set of inputs.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::process::Command;

#[test]
fn a_few_hundred_inputs_of_each_target_do_no_harm() {
    let found = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_dynident-fuzz"))
        // One thread: with several, the speed of the threads would determine which inputs are run.
        .args(["--executions", "8000", "--seconds", "60", "--seed", "8", "--threads", "1", "--found"])
        .arg(found.path())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    // Every target took some of its inputs: seeds that are all refused test nothing.
    let accepted = |line: &str| -> u64 {
        let words: Vec<&str> = line.split_whitespace().collect();
        let at = words.iter().position(|word| word.starts_with("accepted")).unwrap();
        words[at - 1].parse().unwrap()
    };
    let targets: Vec<&str> = text.lines().filter(|line| line.contains("accepted")).collect();
    assert_eq!(targets.len(), 24, "{text}");
    assert!(targets.iter().all(|line| accepted(line) > 0), "{text}");
}
