//! The only place that prints. What is printed may hold text from outside (names in files, file names, what a robot's
//! program says): no character of it steers the terminal.

use core::fmt::Write as _;
use std::io::{self, IsTerminal, Write as _};

/// Prints to standard output. A reader that has gone (`| head`) ends the printing, not the program.
///
/// # Errors
/// What the system says if it cannot be written for another reason (a full device).
pub(crate) fn print(text: &str) -> Result<(), String> {
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
    let _ = writeln!(out, "error: {}", visible(&dynident::shortened(message)));
}

/// A remark, on standard error.
pub(crate) fn remark(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "note: {}", visible(&dynident::shortened(message)));
}

/// A question, on standard error; the answer comes on the same line.
pub(crate) fn ask(question: &str) {
    let mut out = io::stderr().lock();
    let _ = write!(out, "{}", visible(question));
    let _ = out.flush();
}

/// Whether a person watches standard error.
pub(crate) fn watched() -> bool {
    io::stderr().is_terminal()
}

/// `text` with every character that steers a terminal (escape and its kin, backspace, carriage return; overrides of the
/// direction of writing) as `\u001b`, which is also how JSON writes it; newlines stay.
pub(crate) fn visible(text: &str) -> String {
    let steers = |c: char| {
        c.is_control() && c != '\n'
            || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if steers(c) {
            // Writing to a string cannot fail.
            let _ = write!(shown, "\\u{:04x}", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::visible;

    #[test]
    fn nothing_steers_the_terminal() {
        let text = "a\u{1b}[31mb\u{9b}2J\r\u{8}\u{7f}\u{202e}c\nλ Ü 関節";
        assert_eq!(visible(text), "a\\u001b[31mb\\u009b2J\\u000d\\u0008\\u007f\\u202ec\nλ Ü 関節");
    }
}
