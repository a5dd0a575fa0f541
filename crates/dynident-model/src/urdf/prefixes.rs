//! Undeclared namespace prefixes (`<gazebo:plugin>`): the XML parser rejects them, but other URDF readers ignore
//! namespaces. Their colon is replaced by an underscore, so that every byte keeps its position and the new name
//! differs from all names of URDF.

use crate::xml::{outside_quotes, tags};
use std::borrow::Cow;
use std::collections::HashSet;

/// Maximum number of different prefixes that are replaced; a document with more is passed to the parser unchanged.
const MAX_PREFIXES: usize = 100;

pub(super) struct Undeclared<'a> {
    /// Byte position of the first occurrence of the prefix.
    pub(super) at: usize,
    pub(super) prefix: &'a str,
}

/// Replaces the colon after every undeclared prefix by an underscore, and returns the prefixes in the order of the
/// text. One pass is sufficient. The parser reports malformed markup, and xacro has a separate error.
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
    let mut replaced = String::with_capacity(text.len());
    let mut done = 0;
    for colon in colons {
        replaced.push_str(&text[done..colon]);
        replaced.push('_');
        done = colon + 1;
    }
    replaced.push_str(&text[done..]);
    (Cow::Owned(replaced), found)
}

/// Calls `take` with the position of every prefix in the name of an element or attribute.
fn for_each_prefix<'a>(text: &'a str, take: &mut dyn FnMut(usize, &'a str)) {
    for (start, tag) in tags(text) {
        // Start of the current name.
        let mut word = Some(start + 1);
        for (offset, byte) in outside_quotes(tag).skip(1) {
            let place = start + offset;
            match byte {
                b':' => {
                    if let Some(begin) = word.take() {
                        take(begin, &text[begin..place]);
                    }
                }
                b'/' | b' ' | b'\t' | b'\r' | b'\n' => word = Some(place + 1),
                b'=' => word = None,
                _ => {}
            }
        }
    }
}

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
        let (replaced, found) = without_undeclared(text);
        let wanted = text.replace("p:", "p_").replace("s:t", "s_t");
        assert_eq!(replaced, wanted);
        let found: Vec<(&str, usize)> = found.iter().map(|one| (one.prefix, one.at)).collect();
        assert_eq!(found, [("p", text.find("p:").unwrap()), ("s", text.find("s:t").unwrap())]);
        for kept in ["<a", "<a b:c=", "<!-- a:b", "<xacro:if/>", "<:a/>", "<a :b='1'/>"] {
            let expected = kept.replace("b:c", "b_c");
            assert_eq!(without_undeclared(kept).0, expected);
        }
    }
}
