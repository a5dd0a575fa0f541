//! Line and column of a fault in a text.

use core::error::Error;

/// Fault with its line and column in the robot file, both counted from 1. Open the file at this place; the text after
/// the place has the cause.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{line}:{column}: {fault}")]
pub struct Located<F: Error> {
    /// Line, from 1.
    pub line: u32,
    /// Column, from 1, in characters.
    pub column: u32,
    /// The fault, with the fix.
    #[source]
    pub fault: F,
}

impl<F: Error> Located<F> {
    pub(crate) fn at(text: &str, offset: usize, fault: F) -> Self {
        let (line, column) = line_and_column(text, offset);
        Self { line, column, fault }
    }
}

/// Line and column (1-based, in characters) of byte `offset`. For an offset beyond the text or inside a character,
/// the last position before it.
pub fn line_and_column(text: &str, offset: usize) -> (u32, u32) {
    let mut end = offset.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let before = &text[..end];
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    (1 + before.matches('\n').count() as u32, 1 + before[line_start..].chars().count() as u32)
}

#[cfg(test)]
mod tests {
    use super::line_and_column;

    #[test]
    fn columns_count_characters() {
        let text = "é1\nxäy\n";
        assert_eq!(line_and_column(text, 0), (1, 1));
        assert_eq!(line_and_column(text, 2), (1, 2));
        assert_eq!(line_and_column(text, 4), (2, 1));
        assert_eq!(line_and_column(text, 7), (2, 3));
        // Inside the two-byte letter, and past the end.
        assert_eq!(line_and_column(text, 6), (2, 2));
        assert_eq!(line_and_column(text, 999), (3, 1));
    }
}
