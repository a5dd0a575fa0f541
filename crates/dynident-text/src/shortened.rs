//! Shortens long texts.

use std::borrow::Cow;

/// Maximum length of a line of a comment or a message, characters. Longer lines are cut in the middle.
pub const LINE_LENGTH: usize = 2000;

/// `text` shortened to `length` characters: the beginning and the end of a longer text, with the number of omitted
/// characters between them.
pub fn shortened(text: &str, length: usize) -> Cow<'_, str> {
    // A character has at least one byte.
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

/// Maximum number of characters between two backquotes, and in the whole message.
const MAX_CHARS_BETWEEN_QUOTES: usize = 200;
const MAX_MESSAGE_CHARS: usize = 20_000;

/// A message with every text between backquotes shortened to 200 characters, and with at most 20,000 characters. Names,
/// expressions and lines from files are between backquotes; a file may contain a name of megabytes.
pub fn shortened_message(message: &str) -> String {
    let cut = |text: &str, most: usize| {
        let count = text.chars().count();
        if count <= most {
            return text.to_owned();
        }
        let shown: String = text.chars().take(most).collect();
        format!("{shown}.. ({count} characters)")
    };
    let parts = message.split('`').enumerate();
    let parts: Vec<String> =
        parts.map(|(k, part)| cut(part, if k % 2 == 1 { MAX_CHARS_BETWEEN_QUOTES } else { usize::MAX })).collect();
    cut(&parts.join("`"), MAX_MESSAGE_CHARS)
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

    #[test]
    fn a_message_is_shortened_where_it_quotes() {
        let long = "x".repeat(1000);
        assert_eq!(shortened_message("joint `a` is not `b`"), "joint `a` is not `b`");
        let path = format!("/data/{long}: cannot be read");
        assert_eq!(shortened_message(&path), path);
        let message = shortened_message(&format!("no joint `{long}`: give `a`"));
        assert_eq!(message, format!("no joint `{}.. (1000 characters)`: give `a`", "x".repeat(200)));
        assert!(shortened_message(&"a ".repeat(100_000)).ends_with("a .. (200000 characters)"));
    }
}
