//! The pages of the book in the program, and the explanations of messages.

use crate::common::{broken, command, repository, run_in};
use crate::contract::json;
use std::collections::BTreeSet;
use std::process::Stdio;

fn docs(arguments: &[&str]) -> crate::common::CommandOutcome {
    run_in(&broken(), &[&["docs"], arguments].concat())
}

/// Names of the pages in the summary of the book.
fn names() -> Vec<String> {
    let summary = std::fs::read_to_string(repository("docs/src/SUMMARY.md")).unwrap();
    let files = summary.split("](").skip(1).filter_map(|rest| rest.split(".md)").next());
    files.map(str::to_owned).collect()
}

#[test]
fn every_page_of_the_book_is_listed_and_printed() {
    let listed = docs(&[]);
    assert_eq!((listed.status, &listed.stderr[..]), (0, ""));
    let lines: Vec<&str> = listed.stdout.lines().collect();
    let names = names();
    assert!(names.len() > 40);
    for (line, name) in lines.iter().zip(&names) {
        assert!(line.starts_with(&format!("{name} ")) && line.chars().count() <= 80, "{name}: {line}");
    }
    let pages = &json(&docs(&["--json"]).stdout)["pages"];
    for (page, name) in pages.as_array().unwrap().iter().zip(&names) {
        let printed = docs(&[name]);
        assert_eq!((printed.status, &printed.stderr[..]), (0, ""), "{name}");
        assert!(printed.stdout.starts_with(page["title"].as_str().unwrap()), "{name}: {}", &printed.stdout[..200]);
        assert!(!printed.stdout.contains("](") && !printed.stdout.contains('\u{1b}'), "{name}");
    }
}

#[test]
fn a_page_is_found_by_title_and_by_a_unique_part() {
    let page = docs(&["check-methods"]).stdout;
    assert_eq!(docs(&["How check works"]).stdout, page);
    assert_eq!(docs(&["How `check` works"]).stdout, page);
    assert_eq!(docs(&["HECK-METH"]).stdout, page);
    // A name that is part of other names is still a name.
    assert!(docs(&["check"]).stdout.starts_with("Does the study fit?"));
    let text = json(&docs(&["friction", "--json"]).stdout);
    assert_eq!(text["schema"], "dynident/docs/1");
    assert_eq!(text["pages"][0]["text"], std::fs::read_to_string(repository("docs/src/friction.md")).unwrap());
}

#[test]
fn an_unknown_page_has_status_2_and_the_nearest_names() {
    for (wanted, expected) in [("frction", "friction"), ("robot-", "robot-formats"), ("zzzz", "--search")] {
        let ran = docs(&[wanted]);
        assert_eq!((ran.status, &ran.stdout[..]), (2, ""), "{wanted}");
        assert!(ran.stderr.starts_with("error: ") && ran.stderr.contains(expected), "{}", ran.stderr);
    }
}

#[test]
fn a_search_lists_pages_and_headings_with_all_words() {
    let ran = docs(&["--search", "Audit", "osmium"]);
    assert_eq!(ran.status, 0);
    assert_eq!(ran.stdout, "robots: Robots\n  Audit\n");
    assert_eq!(docs(&["--search", "audit osmium"]).stdout, ran.stdout);
    let found = json(&docs(&["--search", "audit", "osmium", "--json"]).stdout);
    assert_eq!(found["pages"][0]["headings"], serde_json::json!(["Audit"]));
    let none = docs(&["--search", "osmium", "unicorn"]);
    assert_eq!((none.status, &none.stdout[..]), (0, "no page contains all of these words: osmium unicorn\n"));
}

/// The code on the last line of an error is that of an entry, whose message is the message of the error.
#[test]
fn the_code_of_an_error_is_explained() {
    let out = tempfile::tempdir().unwrap();
    let out = out.path().display().to_string();
    for (arguments, code, words) in [
        (&["identify", "unknown_key.toml", "--out", &out][..], "study-toml", "The study file"),
        (&["identify", "robot_is_binary.toml", "--out", &out], "read-", "Robots"),
        (&["identify", "rate_negative.toml", "--out", &out], "", "subject"),
        (&["inspect", "gone.urdf"], "read-file", "cannot be read"),
        (&["check", "deep_nesting.toml"], "study-toml", "The study file"),
    ] {
        let ran = run_in(&broken(), arguments);
        assert_eq!(ran.status, 2, "{arguments:?}");
        let last = ran.stderr.trim_end().lines().last().unwrap();
        let printed = last.strip_prefix("help: dynident docs ").unwrap_or_else(|| panic!("{}", ran.stderr));
        assert!(printed.starts_with(code), "{printed}");
        let entry = docs(&[printed]);
        assert_eq!(entry.status, 0, "{printed}: {}", entry.stderr);
        assert!(entry.stdout.starts_with(printed) && entry.stdout.contains(words), "{}", entry.stdout);
        let message = &json(&docs(&[printed, "--json"]).stdout)["message"];
        assert_eq!(message["code"], printed);
        // The message without its placeholders is in the error.
        let template = message["message"].as_str().unwrap();
        let fixed = template.split('}').map(|part| part.split('{').next().unwrap());
        for part in fixed {
            assert!(ran.stderr.contains(part), "{part} is not in {}", ran.stderr);
        }
    }
}

/// In a terminal, headings are bold, and the text has the width of the terminal.
#[cfg(unix)]
#[test]
fn a_terminal_gets_its_width() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{Winsize, tcsetwinsize};
    use std::io::Read;

    let keyboard = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&keyboard).unwrap();
    unlockpt(&keyboard).unwrap();
    tcsetwinsize(&keyboard, Winsize { ws_row: 24, ws_col: 50, ws_xpixel: 0, ws_ypixel: 0 }).unwrap();
    let name = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
    let terminal = std::fs::File::options().read(true).write(true).open(&name).unwrap();
    let mut program = command(&broken(), &["docs", "introduction"]);
    program.env_remove("NO_COLOR").stdout(Stdio::from(terminal));
    let mut child = program.spawn().unwrap();
    drop(program);
    let mut screen = std::fs::File::from(keyboard);
    let (mut text, mut bytes) = (Vec::new(), [0; 4096]);
    // On Linux, reading fails when the program has ended.
    while let Ok(count @ 1..) = screen.read(&mut bytes) {
        text.extend_from_slice(&bytes[..count]);
    }
    assert!(child.wait().unwrap().success());
    let text = String::from_utf8(text).unwrap();
    assert!(text.starts_with("\u{1b}[1m"), "{text}");
    assert!(text.lines().filter(|line| !line.starts_with("    ")).all(|line| line.chars().count() <= 60), "{text}");
    assert!(text.lines().any(|line| line.chars().count() > 40), "{text}");
}

#[test]
fn completions_and_manual_pages_know_the_command() {
    let completions = run_in(&broken(), &["completions", "bash"]);
    assert!(completions.stdout.contains("dynident__subcmd__docs") || completions.stdout.contains("dynident__docs"));
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run_in(folder.path(), &["man", "."]).status, 0);
    assert!(std::fs::read_to_string(folder.path().join("dynident-docs.1")).unwrap().contains("search"));
}

/// Messages name pages, not files of the repository.
#[test]
fn no_message_names_a_file_of_the_repository() {
    for (path, text) in crate::sources::all() {
        for (number, line) in crate::sources::code(&text) {
            let is_own = path.ends_with("src/book.rs") || path.contains("dynident-cli/src/book/");
            let has_path = line.contains("docs/src") || line.contains("docs/decisions");
            assert!(is_own || !has_path, "{path}:{}: {line}", number + 1);
        }
    }
}

#[path = "../../examples/messages.rs"]
#[expect(dead_code, reason = "the example's own main")]
mod example;

#[test]
fn the_page_of_messages_is_that_of_the_sources() {
    let stored = std::fs::read_to_string(example::page_path()).unwrap();
    let again = "make the page again by `cargo run -p dynident-cli --example messages`";
    assert!(example::page().unwrap() == stored, "docs/src/messages.md differs from the sources: {again}");
    let codes = codes(&stored);
    assert!(codes.len() > 500, "{} codes", codes.len());
    let unique: BTreeSet<&String> = codes.iter().collect();
    assert_eq!(unique.len(), codes.len(), "two messages have the same code");
    assert!(names().iter().all(|page| !unique.contains(page)), "a page has the name of a code");
}

/// The codes in the first column of the tables with three columns.
fn codes(page: &str) -> Vec<String> {
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.filter_map(|row| row.split('`').next()).map(str::to_owned).collect()
}

/// Words of the form `name` after `start` in a source, up to a line that ends with a full stop.
fn names_after(text: &str, start: &str) -> Vec<String> {
    let (_, rest) = text.split_once(start).unwrap_or_else(|| panic!("no `{start}`"));
    let (list, _) = rest.split_once(".\n").unwrap();
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// The findings on the page are those that the sources document and use.
#[test]
fn every_finding_is_on_the_page() {
    let page = codes(&std::fs::read_to_string(example::page_path()).unwrap());
    let read = |path: &str| std::fs::read_to_string(repository(path)).unwrap();
    let audit = names_after(&read("crates/dynident-model/src/audit/mod.rs"), "Checks (`check` of the findings):");
    let kinds = names_after(&read("crates/dynident-result/src/check.rs"), "Kind of mistake:");
    let slips = read("crates/dynident-result/src/inspection.rs");
    let slips = names_after(&slips, "An error in the inertials of a URDF.\n#[derive");
    let mut wanted: BTreeSet<String> = [("audit-", audit), ("check-", kinds), ("slip-", slips)]
        .into_iter()
        .flat_map(|(start, names)| names.into_iter().map(move |name| format!("{start}{name}")))
        .collect();
    for (_, text) in crate::sources::all() {
        for (_, line) in crate::sources::code(&text) {
            let literals = line.split('"').skip(1).step_by(2);
            let codes = literals.filter(|word| word.starts_with("import-") || word.starts_with("fit-"));
            wanted.extend(codes.map(str::to_owned));
        }
    }
    assert!(wanted.len() > 70, "{wanted:?}");
    let missing: Vec<&String> = wanted.iter().filter(|code| !page.contains(code)).collect();
    assert!(missing.is_empty(), "not on the page: {missing:?}");
}

/// Every error type of the page has a code at run time, except those that only become part of texts.
#[test]
fn every_public_error_type_has_its_code() {
    const IN_TEXTS: [&str; 13] = [
        "BenchmarkError",
        "LineError",
        "Located",
        "LogTableError",
        "MjcfLoss",
        "NoBodyError",
        "NoStartError",
        "NotRedesigned",
        "Rejection",
        "SdfLoss",
        "TorqueCause",
        "TrajectoryExportError",
        "UnmetCondition",
    ];
    let source = std::fs::read_to_string(repository("crates/dynident/src/error/code.rs")).unwrap();
    for (kind, ..) in example::SECTIONS {
        let has_code = source.contains(&format!("    of::<{kind}>,"));
        assert!(has_code != IN_TEXTS.contains(kind), "{kind}: add it to CODES of error/code.rs or to IN_TEXTS");
    }
}
