//! Namespace prefixes that a document uses and does not declare (`<gazebo:plugin>`): the XML parser must refuse them,
//! other readers of URDF know no namespaces and read on. Their colon becomes an underscore, so that every byte stays
//! at its place and no such name is one of URDF's.

use crate::xml::length_beside_elements;
use std::borrow::Cow;
use std::collections::HashSet;

/// Most different prefixes that are mended; a document with more is left to the parser.
const MAX_PREFIXES: usize = 100;

/// A prefix without a declaration.
pub(super) struct Undeclared<'a> {
    /// Byte at which it stands first.
    pub(super) at: usize,
    pub(super) prefix: &'a str,
}

/// `text` with an underscore for the colon behind every prefix that no `xmlns:` declares, of the same length; and these
/// prefixes, in the order of the text. One pass; malformed markup is left to the parser, and xacro to its own message.
pub(super) fn without_undeclared(text: &str) -> (Cow<'_, str>, Vec<Undeclared<'_>>) {
    let declared: HashSet<&str> = text.match_indices("xmlns:").map(|(at, key)| name(&text[at + key.len()..])).collect();
    let known = |prefix: &str| matches!(prefix, "" | "xml" | "xmlns" | "xacro") || declared.contains(prefix);
    let mut colons = Vec::new();
    let (mut seen, mut found) = (HashSet::new(), Vec::new());
    for_each_prefix(text, &mut |at, prefix| {
        if !known(prefix) {
            colons.push(at + prefix.len());
            if seen.insert(prefix) {
                found.push(Undeclared { at, prefix });
            }
        }
    });
    if colons.is_empty() || found.len() > MAX_PREFIXES {
        return (Cow::Borrowed(text), Vec::new());
    }
    let mut mended = String::with_capacity(text.len());
    let mut done = 0;
    for colon in colons {
        mended.push_str(&text[done..colon]);
        mended.push('_');
        done = colon + 1;
    }
    mended.push_str(&text[done..]);
    (Cow::Owned(mended), found)
}

/// Hands every prefix of an element's or an attribute's name to `take`, with its place.
fn for_each_prefix<'a>(text: &'a str, take: &mut dyn FnMut(usize, &'a str)) {
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|next| at + next) {
        let rest = &text[start..];
        if let Some(length) = length_beside_elements(rest) {
            at = start + length;
            continue;
        }
        let mut quote = None;
        // Where the name that is being read began.
        let mut word = Some(start + 1);
        at = text.len();
        for (offset, byte) in rest.bytes().enumerate().skip(1) {
            let place = start + offset;
            match (quote, byte) {
                (Some(open), byte) if open == byte => quote = None,
                (None, b'>') => {
                    at = place + 1;
                    break;
                }
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b':') => {
                    if let Some(begin) = word.take() {
                        take(begin, &text[begin..place]);
                    }
                }
                (None, b'/' | b' ' | b'\t' | b'\r' | b'\n') => word = Some(place + 1),
                (None, b'=') => word = None,
                (Some(_) | None, _) => {}
            }
        }
    }
}

/// The name with which `text` begins.
fn name(text: &str) -> &str {
    let end = text.find(|c: char| c.is_ascii_whitespace() || matches!(c, '=' | '>' | '/' | '"' | '\'' | '<'));
    &text[..end.unwrap_or(text.len())]
}

#[cfg(test)]
mod tests {
    use super::without_undeclared;

    #[test]
    fn only_names_without_a_declaration_change() {
        let text =
            "<?a b:c?><!-- <d:e> --><r xmlns:k='u:v' k:x=\"m:n\" p:x='q:r'><k:a/><p:b s:t = '1'\n/>z:z</p:b></r>";
        let (mended, found) = without_undeclared(text);
        let wanted = text.replace("p:", "p_").replace("s:t", "s_t");
        assert_eq!(mended, wanted);
        let found: Vec<(&str, usize)> = found.iter().map(|one| (one.prefix, one.at)).collect();
        assert_eq!(found, [("p", text.find("p:").unwrap()), ("s", text.find("s:t").unwrap())]);
        for kept in ["<a", "<a b:c=", "<!-- a:b", "<xacro:if/>", "<:a/>", "<a :b='1'/>"] {
            let expected = kept.replace("b:c", "b_c");
            assert_eq!(without_undeclared(kept).0, expected);
        }
    }
}
