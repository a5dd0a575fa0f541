//! Scans the tags of a document without parsing it.

/// Length of a comment, CDATA section or instruction at the start of a text; the whole text if it is not closed.
pub(crate) fn length_beside_elements(rest: &str) -> Option<usize> {
    let kinds = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
    let (open, close) = kinds.into_iter().find(|(open, _)| rest.starts_with(open))?;
    Some(rest[open.len()..].find(close).map_or(rest.len(), |end| open.len() + end + close.len()))
}

/// Start and text of every tag; comments, CDATA sections and instructions are skipped.
pub(crate) fn tags(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut at = 0;
    core::iter::from_fn(move || {
        loop {
            let start = at + text[at..].find('<')?;
            let rest = &text[start..];
            if let Some(length) = length_beside_elements(rest) {
                at = start + length;
                continue;
            }
            let length = start_tag_length(rest);
            at = start + length;
            return Some((start, &rest[..length]));
        }
    })
}

/// Length of the start tag of `element`: up to the first `>` outside quotes.
pub(crate) fn start_tag_length(element: &str) -> usize {
    outside_quotes(element).find(|(_, byte)| *byte == b'>').map_or(element.len(), |(at, _)| at + 1)
}

/// Bytes outside quoted attribute values, with their positions; the quotes are omitted.
pub(crate) fn outside_quotes(tag: &str) -> impl Iterator<Item = (usize, u8)> {
    let mut quote = None;
    tag.bytes().enumerate().filter(move |&(_, byte)| match (quote, byte) {
        (None, b'"' | b'\'') => {
            quote = Some(byte);
            false
        }
        (None, _) => true,
        (Some(open), byte) => {
            if open == byte {
                quote = None;
            }
            false
        }
    })
}
