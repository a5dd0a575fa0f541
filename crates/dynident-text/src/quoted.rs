//! Strings of YAML and TOML.

use crate::invisible::is_invisible;
use core::fmt::Write;

/// `text` in double quotes for YAML 1.1 and 1.2 and TOML: quotes, backslashes and invisible characters are escaped
/// (`\u202e`, above U+FFFF `\U000e0001`). A parser returns `text`.
///
/// ```
/// assert_eq!(dynident_text::quoted("a \"b\"\n"), r#""a \"b\"\u000a""#);
/// ```
pub fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    push_quoted(&mut out, text);
    out.push('"');
    out
}

/// Appends the escaped `text` without the quotes.
pub(crate) fn push_quoted(out: &mut String, text: &str) {
    for c in text.chars() {
        match c {
            '"' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            c if is_invisible(c) => push_escape(out, c),
            c => out.push(c),
        }
    }
}

pub(crate) fn push_escape(out: &mut String, c: char) {
    // Writing to a string cannot fail.
    let _ = match u32::from(c) {
        code @ ..=0xffff => write!(out, "\\u{code:04x}"),
        code => write!(out, "\\U{code:08x}"),
    };
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn toml_gives_the_text_back(text in any::<String>()) {
            let line = format!("key = {}", quoted(&text));
            prop_assert!(!line.contains(is_invisible));
            let read: toml::Table = line.parse().unwrap();
            prop_assert_eq!(read["key"].as_str(), Some(&*text));
        }
    }
}
