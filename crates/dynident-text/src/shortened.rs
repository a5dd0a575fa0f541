//! Names of a hundred thousand characters.

use std::borrow::Cow;

/// Longest line of a comment or a message, in characters. Longer lines are cut in the middle.
pub const LINE_LENGTH: usize = 2000;

/// `text` with at most `length` characters: of a longer one the beginning and the end, with the number of characters
/// that were left out between them.
pub fn shortened(text: &str, length: usize) -> Cow<'_, str> {
    // A character has one byte or more.
    if text.len() <= length {
        return Cow::Borrowed(text);
    }
    let count = text.chars().count();
    if count <= length {
        return Cow::Borrowed(text);
    }
    let (head, tail) = (length - length / 4, length / 4);
    let at = |place: usize| text.char_indices().nth(place).map_or(text.len(), |(at, _)| at);
    let left_out = count - head - tail;
    Cow::Owned(format!("{} [.. {left_out} characters ..] {}", &text[..at(head)], &text[at(count - tail)..]))
}

/// `text` with each line [`shortened`] to [`LINE_LENGTH`].
pub fn shortened_lines(text: &str) -> Cow<'_, str> {
    if text.len() <= LINE_LENGTH || text.split('\n').all(|line| line.len() <= LINE_LENGTH) {
        return Cow::Borrowed(text);
    }
    let lines: Vec<Cow<'_, str>> = text.split('\n').map(|line| shortened(line, LINE_LENGTH)).collect();
    Cow::Owned(lines.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_of_a_long_text_is_left_out() {
        let text = format!("{}b", "ä".repeat(99));
        assert_eq!(shortened(&text, 100), text);
        assert_eq!(shortened(&text, 8), "ääääää [.. 92 characters ..] äb");
        let lines = format!("a\n{}\nb", "x".repeat(100_000));
        let short = shortened_lines(&lines);
        assert!(short.len() < LINE_LENGTH + 50 && short.starts_with("a\nxxx") && short.ends_with("xxx\nb"), "{short}");
        assert!(matches!(shortened_lines("a\nb"), Cow::Borrowed(_)));
    }
}
