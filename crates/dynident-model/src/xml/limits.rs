//! Guard against documents for which the XML parser needs quadratic time or memory: very many attributes in one tag
//! (each is compared with all others), and very many nested namespaces (each element keeps all of them).

use super::tags::{outside_quotes, tags};

/// Maximum number of attributes in one tag; real descriptions have at most about twelve.
const MAX_ATTRIBUTES: usize = 1000;
/// Maximum number of namespace declarations in a document.
const MAX_NAMESPACES: usize = 5000;

/// Byte position at which a document exceeds the limits of attributes and namespaces, if any. Needs one pass and
/// allocates nothing. The parser finds errors of the markup.
pub(crate) fn first_excess(text: &str) -> Option<usize> {
    if let Some((at, _)) = text.match_indices("xmlns").nth(MAX_NAMESPACES) {
        return Some(at);
    }
    let attributes = |tag: &str| outside_quotes(tag).filter(|(_, byte)| *byte == b'=').count();
    tags(text).find(|(_, tag)| attributes(tag) > MAX_ATTRIBUTES).map(|(start, _)| start)
}

#[cfg(test)]
mod tests {
    use super::first_excess;

    #[test]
    fn a_flood_is_seen_behind_comments_and_quotes() {
        let attributes = r#" a="x>'""#.repeat(1001);
        for before in ["", "<!-- it's <a \" -->", "<?xml it's?>", "<![CDATA[ ' ]]>", "<a b='\"'>"] {
            assert_eq!(first_excess(&format!("{before}<c{attributes}/>")), Some(before.len()), "{before}");
            assert_eq!(first_excess(&format!("{before}<c{}/>", &attributes[8..])), None, "{before}");
        }
        assert_eq!(first_excess(&"<a xmlns:b='c'>".repeat(5001)), Some(5000 * 15 + 3));
        // A missing end is left to the parser.
        assert_eq!(first_excess("<!-- <"), None);
        assert_eq!(first_excess("<a b='"), None);
    }
}
