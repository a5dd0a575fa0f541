//! Lines and numbers of text files with arrays.

/// The lines of a text that are neither blank nor comments, without a byte-order mark.
pub(crate) fn plain_lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    lines(text).filter(|line| !line.is_empty() && !is_comment(line))
}

/// The comments before the first line that is not a comment.
pub(crate) fn comments(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    lines(text).take_while(|line| line.is_empty() || is_comment(line)).filter(|line| !line.is_empty())
}

fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
    text.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii)
}

fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"%")
}

/// The number in a field. True and false are 1 and 0; a decimal comma is allowed unless fields are separated by
/// commas.
pub(crate) fn number(field: &[u8], delimiter: u8) -> Option<f64> {
    let text = core::str::from_utf8(field.trim_ascii()).ok()?;
    if let Ok(value) = text.parse() {
        return Some(value);
    }
    match text {
        "true" | "True" | "TRUE" => Some(1.0),
        "false" | "False" | "FALSE" => Some(0.0),
        _ if delimiter != b',' && text.matches(',').count() == 1 && !text.contains('.') => {
            text.replace(',', ".").parse().ok()
        }
        _ => None,
    }
}
