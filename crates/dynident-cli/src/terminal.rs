//! The only place that prints. What is printed may hold text from outside (names in files, file names, what a robot's
//! program says): no character of it steers the terminal.

use dynident_text::{shortened_lines, visible};
use std::io::{self, IsTerminal, Write as _};

/// Prints text for people to standard output, with long lines shortened. A reader that has gone (`| head`) ends the
/// printing, not the program.
///
/// # Errors
/// What the system says if it cannot be written for another reason (a full device).
pub(crate) fn print(text: &str) -> Result<(), String> {
    print_document(&shortened_lines(text))
}

/// Prints what a program reads (JSON, code, a study) to standard output: as [`print`], but whole.
///
/// # Errors
/// As [`print`].
pub(crate) fn print_document(text: &str) -> Result<(), String> {
    let mut out = io::stdout().lock();
    let text = visible(text);
    let end = if text.ends_with('\n') { "" } else { "\n" };
    written(write!(out, "{text}{end}").and_then(|()| out.flush()))
}

/// Prints text that is the program's own, byte by byte: a script may hold tabs.
///
/// # Errors
/// As [`print`].
pub(crate) fn print_own(text: &[u8]) -> Result<(), String> {
    let mut out = io::stdout().lock();
    written(out.write_all(text).and_then(|()| out.flush()))
}

/// What came of writing to standard output; a reader that has gone has seen what it wanted.
pub(crate) fn written(outcome: io::Result<()>) -> Result<(), String> {
    match outcome {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("standard output: cannot be written: {error}; what was printed is not complete"))
        }
        _ => Ok(()),
    }
}

/// An error, on standard error, as clap words its own.
pub(crate) fn complain(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "error: {}", readable(&dynident::shortened_message(message)));
}

/// A remark, on standard error.
pub(crate) fn remark(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "note: {}", readable(&dynident::shortened_message(message)));
}

/// A question, on standard error; the answer comes on the same line. It is not shortened: nothing of a command that a
/// person allows is left out.
pub(crate) fn ask(question: &str) {
    let mut out = io::stderr().lock();
    let _ = write!(out, "{}", visible(question));
    let _ = out.flush();
}

/// Whether a person watches standard error.
pub(crate) fn watched() -> bool {
    io::stderr().is_terminal()
}

/// Text for people: no character controls the terminal, and long lines are shortened.
pub(crate) fn readable(text: &str) -> String {
    shortened_lines(&visible(text)).into_owned()
}

#[cfg(test)]
mod tests {
    use super::readable;

    #[test]
    fn nothing_steers_the_terminal_and_nothing_fills_it() {
        let text = format!("a\u{1b}[31mb\u{9b}2J\r\u{202e}c\nλ Ü 関節 {}", "x".repeat(100_000));
        let shown = readable(&text);
        assert!(
            shown.starts_with("a\\u001b[31mb\\u009b2J\\u000d\\u202ec\nλ Ü 関節 xxx") && shown.len() < 2200,
            "{shown}"
        );
    }
}
