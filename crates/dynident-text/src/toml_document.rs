//! A whole document of TOML.

use crate::invisible::{escape, is_invisible, replaced};
use crate::quoted::{push_escape, push_quoted};
use std::borrow::Cow;

/// A TOML document without invisible characters except white space and the byte order mark at its start. Comments
/// contain `\u202e` instead; strings get escape sequences, for which literal strings become basic ones. The data are
/// unchanged.
pub fn toml_document(text: &str) -> Cow<'_, str> {
    let mark = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let hidden = |c: char| !matches!(c, '\n' | '\r' | '\t') && is_invisible(c);
    if !text[mark..].contains(hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 64);
    out.push_str(&text[..mark]);
    let mut rest = &text[mark..];
    while let Some(first) = rest.chars().next() {
        let quotes = ["\"\"\"", "'''", "\"", "'"].into_iter().find(|quotes| rest.starts_with(quotes));
        let (length, piece): (usize, String) = match (quotes, first) {
            (Some(quotes), _) => {
                let length = string_length(rest, quotes);
                let piece = &rest[..length];
                (length, if piece.contains(hidden) { string(piece, quotes, hidden) } else { piece.to_owned() })
            }
            (None, '#') => {
                let length = rest.find('\n').unwrap_or(rest.len());
                (length, replaced(&rest[..length], hidden, escape).into_owned())
            }
            // Valid TOML has no such character here.
            (None, _) => (first.len_utf8(), replaced(&rest[..first.len_utf8()], hidden, escape).into_owned()),
        };
        out.push_str(&piece);
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

/// Length of the string that starts with `quotes`; the whole text if it does not end.
fn string_length(text: &str, quotes: &str) -> usize {
    let is_basic = quotes.starts_with('"');
    let mut at = quotes.len();
    while at < text.len() {
        if is_basic && text[at..].starts_with('\\') {
            at += 1 + text[at + 1..].chars().next().map_or(0, char::len_utf8);
        } else if text[at..].starts_with(quotes) {
            at += quotes.len();
            // Up to two more quotes belong to a multi-line string.
            let more = if quotes.len() == 3 {
                text[at..].bytes().take(2).take_while(|b| *b == quotes.as_bytes()[0]).count()
            } else {
                0
            };
            return at + more;
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    text.len()
}

/// A string with escape sequences; a literal string becomes a basic string with the same text.
fn string(piece: &str, quotes: &str, hidden: impl Fn(char) -> bool) -> String {
    if quotes.starts_with('"') {
        return replaced(piece, hidden, push_escape).into_owned();
    }
    let inside = piece.strip_prefix(quotes).unwrap_or(piece);
    let inside = inside.strip_suffix(quotes).unwrap_or(inside);
    // A newline directly after the quotes is not part of the text.
    let inside = if quotes.len() == 3 {
        inside.strip_prefix("\r\n").or(inside.strip_prefix('\n')).unwrap_or(inside)
    } else {
        inside
    };
    let mut out = String::from("\"");
    push_quoted(&mut out, inside);
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_data_are_the_same() {
        let text = "\u{feff}# a \u{202e} 'comment\"\nbasic = \"a\\\"\u{202e}\" # \u{200b}\r\nliteral = 'a\\\"\u{e0001}'\n\
            lines = \"\"\"\nx\u{2066}\\\ny\"\" \\\"\u{200b}\"\"\"\"\nlines_too = '''\n\tx\\\u{2066}''y'''''\n[\"q\u{9b}\"]\n'k\u{ad}' = ['\u{61c}', 1.0]\n";
        let safe = toml_document(text);
        assert!(!safe[3..].contains(|c: char| !c.is_ascii()), "{safe}");
        let read = |text: &str| text.trim_start_matches('\u{feff}').parse::<toml::Table>().unwrap();
        assert_eq!(read(text), read(&safe), "{safe}");
        assert!(matches!(toml_document("a = 'é'\n"), Cow::Borrowed("a = 'é'\n")));
        // Invalid TOML does not cause a panic.
        for text in ["\"\\", "'''\u{202e}", "\u{202e}", "\"\"\"\u{202e}\\"] {
            assert!(!toml_document(text).contains('\u{202e}'));
        }
    }
}
