//! Macros of descriptions, written out by the program of those who made them.

use std::io::{ErrorKind, Read};
use std::path::Path;
use std::process::{Command, Stdio};

/// The program.
const PROGRAM: &str = "xacro";
/// Bytes of its complaints that a message shows at most.
const SHOWN: usize = 400;

/// Why nothing was written out.
#[derive(Debug)]
pub(crate) enum XacroFailure {
    /// More text than was asked for.
    TooLarge,
    /// The program says that it cannot.
    Refused(String),
}

/// Whether a text has macros that stand for something else. A declaration alone, as written-out files often keep, is
/// none.
pub(crate) fn has_macros(text: &str) -> bool {
    text.contains("xmlns:xacro") && ["<xacro:", "${", "$("].iter().any(|sign| text.contains(sign))
}

/// The text of at most `most_bytes` that `xacro` makes of the file; `None` where the program is not installed.
///
/// # Errors
/// If the program fails, or writes more, or no text.
pub(crate) fn written_out(path: &Path, most_bytes: u64) -> Result<Option<String>, XacroFailure> {
    let refused = XacroFailure::Refused;
    let started =
        Command::new(PROGRAM).arg(path).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = match started {
        Ok(child) => child,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(refused(error.to_string())),
    };
    // Read side by side: a pipe that is full would stop the program.
    let complaints = child.stderr.take().map(|stderr| {
        std::thread::spawn(move || {
            let mut text = Vec::new();
            let _ = stderr.take(1 << 20).read_to_end(&mut text);
            String::from_utf8_lossy(&text).into_owned()
        })
    });
    let mut bytes = Vec::new();
    if let Some(stdout) = child.stdout.take() {
        stdout.take(most_bytes + 1).read_to_end(&mut bytes).map_err(|error| refused(error.to_string()))?;
    }
    if bytes.len() as u64 > most_bytes {
        let _ = child.kill();
        let _ = child.wait();
        return Err(XacroFailure::TooLarge);
    }
    let status = child.wait().map_err(|error| refused(error.to_string()))?;
    let complaints = complaints.and_then(|reader| reader.join().ok()).unwrap_or_default();
    if !status.success() {
        // What went wrong stands at the end.
        let end = complaints.trim();
        let start = (end.len().saturating_sub(SHOWN)..end.len()).find(|&at| end.is_char_boundary(at)).unwrap_or(0);
        return Err(refused(format!("{status}: {}", end[start..].replace('\n', " "))));
    }
    String::from_utf8(bytes).map(Some).map_err(|_| refused("it wrote no UTF-8 text".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::has_macros;

    #[test]
    fn a_declaration_is_no_macro() {
        let declared = r#"<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">"#;
        assert!(!has_macros(declared));
        assert!(has_macros(&format!("{declared}<xacro:property name=\"m\" value=\"2\"/>")));
        assert!(!has_macros(r#"<robot name="${r}"/>"#));
    }
}
