//! Shared parts of the XML readers and writers: guards, numbers, and edits that keep all other bytes.

pub(crate) mod edit;
mod limits;
mod malformed;
mod number;
mod tags;

pub(crate) use limits::first_excess;
pub(crate) use malformed::{Malformed, malformed};
pub(crate) use number::{parse_number, shortened};
pub(crate) use tags::{outside_quotes, start_tag_length, tags};

use tags::length_beside_elements;

/// Maximum number of elements, texts and comments in a document: a hundred times the largest known robot.
pub(crate) const MAX_NODES: u32 = 2_000_000;

/// Name of the root element of `text`, without parsing the rest.
pub(crate) fn root_name(text: &str) -> Option<&str> {
    let mut rest = text;
    loop {
        rest = &rest[rest.find('<')?..];
        match length_beside_elements(rest) {
            Some(length) => rest = &rest[length..],
            // Skips a document type declaration; the parser rejects it later.
            None if rest.starts_with("<!") => rest = &rest[2..],
            None => break,
        }
    }
    let name = &rest[1..];
    let end = name.find(|c: char| c.is_ascii_whitespace() || matches!(c, '>' | '/' | '<'));
    Some(&name[..end.unwrap_or(name.len())])
}

#[cfg(test)]
mod tests {
    use super::root_name;

    #[test]
    fn root_is_found_after_comments_and_instructions() {
        assert_eq!(root_name("\u{feff}<?xml version='1.0'?>\n<!-- <robot> -->\n<mujoco model=\"a\">"), Some("mujoco"));
        assert_eq!(root_name("<robot>"), Some("robot"));
        assert_eq!(root_name("<mujoco/>"), Some("mujoco"));
        assert_eq!(root_name("<!DOCTYPE a><b/>"), Some("b"));
        for none in ["", "text", "<!--", "<?xml", "<!-- <a> "] {
            assert_eq!(root_name(none), None, "{none}");
        }
    }
}
