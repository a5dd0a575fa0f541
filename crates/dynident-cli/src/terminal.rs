//! The only place that prints.

use std::io::{self, IsTerminal, Write};

/// Prints to standard output. A reader that has gone (`| head`) ends the printing, not the program.
pub(crate) fn print(text: &str) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(text.as_bytes());
    if !text.ends_with('\n') {
        let _ = out.write_all(b"\n");
    }
}

/// An error, on standard error, as clap words its own.
pub(crate) fn complain(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "error: {message}");
}

/// A remark, on standard error.
pub(crate) fn remark(message: &str) {
    let mut out = io::stderr().lock();
    let _ = writeln!(out, "note: {message}");
}

/// Whether a person watches standard error.
pub(crate) fn watched() -> bool {
    io::stderr().is_terminal()
}
