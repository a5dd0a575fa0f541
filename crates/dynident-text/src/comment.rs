//! Comments of programming languages.

use crate::invisible::{escape, is_invisible};
use crate::shortened::{LINE_LENGTH, shortened};

/// `text` as part of a one-line comment in C, C++, Rust, Python, MATLAB, YAML or TOML. It cannot end the comment:
///
/// - invisible characters, including newlines, are escaped as `\u000a`; long texts are shortened;
/// - `*/` and `/*` are separated by a blank, so a block comment neither ends nor nests;
/// - `??` is separated, because the trigraph `??/` is a backslash in C;
/// - a backslash at the end, which joins lines in C and C++, is escaped as `\u005c`;
/// - `coding:` and `coding=` are separated, because Python reads the encoding of a file from a comment in its first two
///   lines (PEP 263), and text in UTF-7 may contain newlines.
///
/// ```
/// assert_eq!(dynident_text::comment("arm */ int x; /*\nimport os"), "arm * / int x; / *\\u000aimport os");
/// ```
pub fn comment(text: &str) -> String {
    let text = shortened(text, LINE_LENGTH);
    let mut out = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        let divides = match (out.chars().next_back(), c) {
            (Some('*'), '/') | (Some('/'), '*') | (Some('?'), '?') => true,
            (_, ':' | '=') => ends_with_coding(&out),
            _ => false,
        };
        if divides {
            out.push(' ');
        }
        if is_invisible(c) {
            escape(&mut out, c);
        } else {
            out.push(c);
        }
    }
    // GCC joins lines also if blanks follow the backslash.
    let end = out.trim_end().len();
    if out[..end].ends_with('\\') {
        out.replace_range(end - 1.., "\\u005c");
    }
    out
}

fn ends_with_coding(text: &str) -> bool {
    text.len().checked_sub("coding".len()).is_some_and(|from| text.as_bytes()[from..].eq_ignore_ascii_case(b"coding"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn comments_do_not_end() {
        for (text, safe) in [
            ("Arm 3, axis_2 at 50 %", "Arm 3, axis_2 at 50 %"),
            ("a*/b", "a* /b"),
            ("/*/", "/ * /"),
            ("???/", "? ? ?/"),
            ("C:\\logs\\ \t", "C:\\logs\\ \\u0009"),
            ("C:\\logs\\  ", "C:\\logs\\u005c"),
            ("vim: fileencoding=utf-7", "vim: fileencoding =utf-7"),
            ("-*- Coding: rot13 -*-", "-*- Coding : rot13 -*-"),
            ("a\r\u{2028}\u{85}b", "a\\u000d\\u2028\\u0085b"),
        ] {
            assert_eq!(comment(text), safe);
        }
        assert!(comment(&"x*/".repeat(100_000)).len() < 4000);
    }

    proptest! {
        #[test]
        fn no_text_ends_a_comment(text in "[a*/?\\\\ \n\r\u{85}\u{202e}codingCODING:=]{0,60}") {
            let safe = comment(&text);
            prop_assert!(!safe.contains("*/") && !safe.contains("/*") && !safe.contains("??"), "{safe}");
            prop_assert!(!safe.trim_end().ends_with('\\') && !safe.contains(is_invisible), "{safe}");
            let lower = safe.to_lowercase();
            prop_assert!(!lower.contains("coding:") && !lower.contains("coding="), "{safe}");
        }
    }
}
