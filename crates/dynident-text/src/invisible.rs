//! Invisible characters and their escape sequences.

use core::fmt::Write;
use std::borrow::Cow;

/// Ranges of the class Cf (format) of Unicode 16.0, without the characters covered by [`char::is_control`].
const FORMAT_RANGES: [(char, char); 21] = [
    ('\u{ad}', '\u{ad}'),
    ('\u{600}', '\u{605}'),
    ('\u{61c}', '\u{61c}'),
    ('\u{6dd}', '\u{6dd}'),
    ('\u{70f}', '\u{70f}'),
    ('\u{890}', '\u{891}'),
    ('\u{8e2}', '\u{8e2}'),
    ('\u{180e}', '\u{180e}'),
    ('\u{200b}', '\u{200f}'),
    ('\u{202a}', '\u{202e}'),
    ('\u{2060}', '\u{2064}'),
    ('\u{2066}', '\u{206f}'),
    ('\u{feff}', '\u{feff}'),
    ('\u{fff9}', '\u{fffb}'),
    ('\u{110bd}', '\u{110bd}'),
    ('\u{110cd}', '\u{110cd}'),
    ('\u{13430}', '\u{1343f}'),
    ('\u{1bca0}', '\u{1bca3}'),
    ('\u{1d173}', '\u{1d17a}'),
    ('\u{e0001}', '\u{e0001}'),
    ('\u{e0020}', '\u{e007f}'),
];

/// Whether a character is invisible and may change the display of other characters or the parsing by a program: the
/// Unicode classes Cc (control), Cf (format, including overrides of the writing direction), Zl and Zp (line and
/// paragraph separators), and U+FFFE and U+FFFF, which XML forbids.
pub fn is_invisible(c: char) -> bool {
    // Fast path, because most text is ASCII.
    if c.is_ascii() {
        return c.is_control();
    }
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{fffe}' | '\u{ffff}')
        || FORMAT_RANGES.iter().any(|(first, last)| (*first..=*last).contains(&c))
}

/// `text` with each invisible character except the newline as `\u202e`, the escape sequence of JSON (two sequences
/// above U+FFFF). A JSON document keeps its data, and a page or a terminal shows the character.
///
/// ```
/// assert_eq!(dynident_text::visible("a\u{202e}b\u{1b}[31m\nc"), "a\\u202eb\\u001b[31m\nc");
/// ```
pub fn visible(text: &str) -> Cow<'_, str> {
    replaced(text, |c| c != '\n' && is_invisible(c), escape)
}

/// As [`visible`], including the newline, so that the text stays on one line.
pub fn one_line(text: &str) -> Cow<'_, str> {
    replaced(text, is_invisible, escape)
}

pub(crate) fn escape(out: &mut String, c: char) {
    for unit in c.encode_utf16(&mut [0; 2]) {
        // Writing to a string cannot fail.
        let _ = write!(out, "\\u{unit:04x}");
    }
}

/// `text` with each character that satisfies `wanted` replaced by the output of `with`; the text itself if there is no
/// such character.
pub(crate) fn replaced(
    text: &str,
    wanted: impl Fn(char) -> bool,
    mut with: impl FnMut(&mut String, char),
) -> Cow<'_, str> {
    let Some(first) = text.find(&wanted) else { return Cow::Borrowed(text) };
    let mut out = String::with_capacity(text.len() + 16);
    out.push_str(&text[..first]);
    for c in text[first..].chars() {
        if wanted(c) {
            with(&mut out, c);
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use unicode_general_category::{GeneralCategory, get_general_category};

    /// Compares the table with the Unicode Character Database of another crate.
    #[test]
    fn classes_are_those_of_unicode() {
        for c in '\0'..=char::MAX {
            let is_class = matches!(
                get_general_category(c),
                GeneralCategory::Control
                    | GeneralCategory::Format
                    | GeneralCategory::LineSeparator
                    | GeneralCategory::ParagraphSeparator
            );
            assert_eq!(is_invisible(c), is_class || matches!(c, '\u{fffe}' | '\u{ffff}'), "{:x}", u32::from(c));
        }
    }

    #[test]
    fn invisible_characters_are_shown_and_visible_ones_stay() {
        let text = "a\u{1b}[31mb\u{9b}2J\r\u{8}\t\u{7f}\u{202e}c\nλ Ü 関節 é";
        let shown = "a\\u001b[31mb\\u009b2J\\u000d\\u0008\\u0009\\u007f\\u202ec\nλ Ü 関節 é";
        assert_eq!(visible(text), shown);
        assert_eq!(one_line(text), shown.replace('\n', "\\u000a"));
        // A surrogate pair, as in JSON.
        assert_eq!(visible("\u{e0001}"), "\\udb40\\udc01");
        assert!(matches!(visible("joint_1 Ü"), Cow::Borrowed(_)));
    }
}
