//! Guard against documents for which the XML parser needs quadratic time or memory: very many attributes in one tag
//! (each is compared with all others), and very many nested namespaces (each element keeps all of them).

/// Maximum number of attributes in one tag; real descriptions have at most about twelve.
const MAX_ATTRIBUTES: usize = 1000;
/// Maximum number of namespace declarations in a document.
const MAX_NAMESPACES: usize = 5000;

/// Length of a comment, CDATA section or instruction at the start of a text; the whole text if it is not closed.
pub(crate) fn length_beside_elements(rest: &str) -> Option<usize> {
    let kinds = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")];
    let (open, close) = kinds.into_iter().find(|(open, _)| rest.starts_with(open))?;
    Some(rest[open.len()..].find(close).map_or(rest.len(), |end| open.len() + end + close.len()))
}

/// Byte position at which a document exceeds the limits, if any. Needs one pass and no memory; malformed markup is left
/// to the parser.
pub(crate) fn flood(text: &str) -> Option<usize> {
    if let Some((at, _)) = text.match_indices("xmlns").nth(MAX_NAMESPACES) {
        return Some(at);
    }
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|next| at + next) {
        let rest = &text[start..];
        if let Some(length) = length_beside_elements(rest) {
            at = start + length;
            continue;
        }
        let (mut quote, mut attributes, mut length) = (None, 0, rest.len());
        for (offset, byte) in rest.bytes().enumerate() {
            match (quote, byte) {
                (None, b'>') => {
                    length = offset + 1;
                    break;
                }
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'=') => attributes += 1,
                (Some(open), byte) if open == byte => quote = None,
                _ => {}
            }
            if attributes > MAX_ATTRIBUTES {
                return Some(start);
            }
        }
        at = start + length;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::flood;

    #[test]
    fn a_flood_is_seen_behind_comments_and_quotes() {
        let attributes = r#" a="x>'""#.repeat(1001);
        for before in ["", "<!-- it's <a \" -->", "<?xml it's?>", "<![CDATA[ ' ]]>", "<a b='\"'>"] {
            assert_eq!(flood(&format!("{before}<c{attributes}/>")), Some(before.len()), "{before}");
            assert_eq!(flood(&format!("{before}<c{}/>", &attributes[8..])), None, "{before}");
        }
        assert_eq!(flood(&"<a xmlns:b='c'>".repeat(5001)), Some(5000 * 15 + 3));
        // A missing end is left to the parser.
        assert_eq!(flood("<!-- <"), None);
        assert_eq!(flood("<a b='"), None);
    }
}
