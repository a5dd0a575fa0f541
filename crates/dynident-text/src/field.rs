//! Cells of tables.

use crate::invisible::one_line;
use std::borrow::Cow;

/// `text` as a field of CSV (RFC 4180): in quotes if it contains a comma, a quote or a blank at an end. Invisible
/// characters are escaped as `\u000a`. A field that a spreadsheet would interpret as a formula gets an apostrophe.
///
/// ```
/// assert_eq!(dynident_text::csv_field("elbow, left"), "\"elbow, left\"");
/// assert_eq!(dynident_text::csv_field("=cmd|' /C calc'!A0"), "'=cmd|' /C calc'!A0");
/// ```
pub fn csv_field(text: &str) -> Cow<'_, str> {
    let mut field = one_line(text);
    if field.starts_with(['=', '+', '-', '@']) {
        field = Cow::Owned(format!("'{field}"));
    }
    if field.contains([',', '"', ';']) || field.trim() != field {
        field = Cow::Owned(format!("\"{}\"", field.replace('"', "\"\"")));
    }
    field
}

/// `text` as a cell or a line of Markdown, without markup, HTML or the end of a cell.
///
/// ```
/// assert_eq!(dynident_text::markdown("a|b <i>"), "a\\|b &lt;i>");
/// ```
pub fn markdown(text: &str) -> String {
    // Escape backslashes of the text before adding others.
    let mut out = String::with_capacity(text.len());
    for c in one_line(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '|' | '`' | '[' | ']' | '\\' => {
                out.push('\\');
                out.push(c);
            }
            c => out.push(c),
        }
    }
    out
}

/// `text` as a cell of a LaTeX table or a part of its text: special characters are escaped, and signs that the default
/// fonts lack are commands.
///
/// ```
/// assert_eq!(dynident_text::latex("m_1 ± 5 %"), "m\\_1 \\ensuremath{\\pm} 5 \\%");
/// ```
pub fn latex(text: &str) -> String {
    let text = one_line(text);
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        let command = match c {
            '\\' => "\\textbackslash{}",
            '~' => "\\textasciitilde{}",
            '^' => "\\textasciicircum{}",
            '<' => "\\textless{}",
            '>' => "\\textgreater{}",
            '|' => "\\textbar{}",
            '±' => "\\ensuremath{\\pm}",
            '−' => "\\ensuremath{-}",
            '·' => "\\ensuremath{\\cdot}",
            '²' => "\\ensuremath{^2}",
            '³' => "\\ensuremath{^3}",
            '°' => "\\ensuremath{^\\circ}",
            '–' => "--",
            '\u{a0}' => "~",
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
                continue;
            }
            // After the end of a row, these would be an argument of `\\`.
            '[' => "{[}",
            '*' => "{*}",
            c => {
                out.push(c);
                continue;
            }
        };
        out.push_str(command);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_stay_one_field() {
        for (text, field) in [
            ("elbow", "elbow"),
            ("joint \"0\", a", "\"joint \"\"0\"\", a\""),
            ("a\nb\r", "a\\u000ab\\u000d"),
            ("-2+3", "'-2+3"),
            ("\t=1", "\\u0009=1"),
            (" a", "\" a\""),
        ] {
            assert_eq!(csv_field(text), field);
        }
        assert_eq!(
            latex("\\x{a}\n%$#_^~&[*"),
            concat!(
                "\\textbackslash{}x\\{a\\}\\textbackslash{}u000a\\%\\$\\#\\_",
                "\\textasciicircum{}\\textasciitilde{}\\&{[}{*}"
            )
        );
        assert_eq!(markdown("a\\|`x`[y](z)\u{202e}"), "a\\\\\\|\\`x\\`\\[y\\](z)\\\\u202e");
    }
}
