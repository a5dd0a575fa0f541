//! Everything that the program prints. Printed text may contain external text (names in files, file names, output of
//! robot programs), so control characters are made visible.

use dynident_text::{shortened_lines, visible};
use std::io::{self, IsTerminal, Write as _};

/// Number of columns of the text if it is not printed to a terminal.
const DEFAULT_WIDTH: usize = 80;

/// Prints text for people to standard output, with long lines shortened. A closed pipe (`| head`) ends the printing,
/// not the program.
pub(crate) fn print(text: &str) -> Result<(), String> {
    print_document(&shortened_lines(text))
}

/// Prints text for programs (JSON, code, a study) to standard output, without shortened lines.
pub(crate) fn print_document(text: &str) -> Result<(), String> {
    let mut out = io::stdout().lock();
    let text = visible(text);
    let end = if text.ends_with('\n') { "" } else { "\n" };
    written(write!(out, "{text}{end}").and_then(|()| out.flush()))
}

/// Prints text that is part of the program, without changes; a script may contain tabs.
pub(crate) fn print_own(text: &[u8]) -> Result<(), String> {
    let mut out = io::stdout().lock();
    written(out.write_all(text).and_then(|()| out.flush()))
}

/// Converts the result of writing to standard output; a closed pipe is not an error.
pub(crate) fn written(outcome: io::Result<()>) -> Result<(), String> {
    match outcome {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("standard output: cannot be written: {error}; the output is incomplete"))
        }
        _ => Ok(()),
    }
}

/// Prints an error on standard error, in the style of clap.
pub(crate) fn complain(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "error: {}", readable(&dynident::shortened_message(message)));
}

pub(crate) fn remark(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "note: {}", readable(&dynident::shortened_message(message)));
}

/// Prints a line about the progress of a job on standard error.
pub(crate) fn progress(line: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "progress: {}", readable(line));
}

/// Prints a question on standard error; the answer is typed on the same line. It is not shortened, so that a command is
/// shown completely before it is permitted.
pub(crate) fn ask(question: &str) {
    let mut out = io::stderr().lock();
    let _ = write!(out, "{}", visible(question));
    let _ = out.flush();
}

/// Columns of text for people: those of the terminal, otherwise 80.
#[cfg(unix)]
pub(crate) fn width() -> usize {
    let size = rustix::termios::tcgetwinsize(io::stdout());
    size.ok().map(|size| usize::from(size.ws_col)).filter(|&columns| columns > 0).unwrap_or(DEFAULT_WIDTH)
}

/// Columns of text for people.
#[cfg(not(unix))]
pub(crate) fn width() -> usize {
    DEFAULT_WIDTH
}

/// Whether standard output shows bold text.
pub(crate) fn is_styled() -> bool {
    io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

pub(crate) fn watched() -> bool {
    io::stderr().is_terminal()
}

/// Text for people: control characters are made visible, and long lines are shortened.
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
