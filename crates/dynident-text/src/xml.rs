//! XML: URDF, MJCF, SDF, SVG.

use crate::invisible::{escape, is_invisible, replaced};
use crate::shortened::{LINE_LENGTH, shortened};
use core::fmt::Write;
use std::borrow::Cow;

/// Whether XML 1.0 allows a character (production 2, `Char`).
fn is_allowed(c: char) -> bool {
    !matches!(c, '\0'..='\u{8}' | '\u{b}' | '\u{c}' | '\u{e}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}')
}

/// Appends a reference to a character, or `\u0001` for a character that XML does not allow.
fn reference(out: &mut String, c: char) {
    if is_allowed(c) {
        // Writing to a string cannot fail.
        let _ = write!(out, "&#x{:x};", u32::from(c));
    } else {
        escape(out, c);
    }
}

/// `text` as the value of an attribute in single or double quotes, or as the text of an element: markup characters
/// become entities, invisible characters references. A parser returns `text`, with two exceptions: control characters
/// that XML does not allow become `\u0001`; `${` and `$(`, which the preprocessor xacro evaluates as Python, become
/// `\u0024{`.
///
/// ```
/// assert_eq!(dynident_text::xml::escaped("a\"><b/>\u{202e}"), "a&quot;&gt;&lt;b/&gt;&#x202e;");
/// ```
pub fn escaped(text: &str) -> Cow<'_, str> {
    let special = |c: char| matches!(c, '&' | '<' | '>' | '"' | '\'') || is_invisible(c);
    if let Some(text) = without_xacro(text) {
        return Cow::Owned(escaped(&text).into_owned());
    }
    replaced(text, special, |out, c| match c {
        '&' => out.push_str("&amp;"),
        '<' => out.push_str("&lt;"),
        '>' => out.push_str("&gt;"),
        '"' => out.push_str("&quot;"),
        '\'' => out.push_str("&apos;"),
        c => reference(out, c),
    })
}

/// `text` without xacro expressions; `None` if it contains none.
fn without_xacro(text: &str) -> Option<String> {
    let has = text.contains("${") || text.contains("$(");
    has.then(|| text.replace("${", "\\u0024{").replace("$(", "\\u0024("))
}

/// `text` as part of a one-line comment: two hyphens are separated, a hyphen at the end is followed by a blank,
/// invisible characters become `\u000a` and `${` becomes `\u0024{`, long texts are shortened.
pub fn comment(text: &str) -> String {
    let plain = without_xacro(text);
    let text = shortened(plain.as_deref().unwrap_or(text), LINE_LENGTH);
    let mut out = String::with_capacity(text.len() + 1);
    for c in text.chars() {
        if c == '-' && out.ends_with('-') {
            out.push(' ');
        }
        if is_invisible(c) {
            escape(&mut out, c);
        } else {
            out.push(c);
        }
    }
    if out.ends_with('-') {
        out.push(' ');
    }
    out
}

/// An XML document without invisible characters except white space and the byte order mark at its start: references in
/// attributes and text, with unchanged data; `\u202e` in comments, processing instructions and character data, where
/// references are not allowed. A joiner inside an element's name remains.
pub fn document(text: &str) -> Cow<'_, str> {
    let mark = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let hidden = |c: char| !matches!(c, '\n' | '\r' | '\t') && is_invisible(c);
    if !text[mark..].contains(hidden) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 64);
    out.push_str(&text[..mark]);
    let mut rest = &text[mark..];
    while !rest.is_empty() {
        let (length, with): (usize, fn(&mut String, char)) = match rest {
            _ if rest.starts_with("<!--") => (through(rest, "-->"), escape),
            _ if rest.starts_with("<![CDATA[") => (through(rest, "]]>"), escape),
            _ if rest.starts_with("<?") => (through(rest, "?>"), escape),
            _ if rest.starts_with("<!") => (through(rest, ">"), escape),
            _ if rest.starts_with('<') => {
                let end = tag_length(rest);
                push_tag(&mut out, &rest[..end], hidden);
                rest = &rest[end..];
                continue;
            }
            _ => (rest.find('<').unwrap_or(rest.len()), reference),
        };
        out.push_str(&replaced(&rest[..length], hidden, with));
        rest = &rest[length..];
    }
    Cow::Owned(out)
}

/// Length up to and including `end`; the whole text if `end` is missing.
fn through(text: &str, end: &str) -> usize {
    text.find(end).map_or(text.len(), |at| at + end.len())
}

/// Length of the tag at the start of `text`: to the first `>` outside quotes.
fn tag_length(text: &str) -> usize {
    let mut quote = None;
    for (at, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return at + 1,
            (None, b'"' | b'\'') => quote = Some(byte),
            (Some(open), byte) if open == byte => quote = None,
            _ => {}
        }
    }
    text.len()
}

/// Appends a tag with references in the values of its attributes.
fn push_tag(out: &mut String, tag: &str, hidden: impl Fn(char) -> bool) {
    let mut quote = None;
    for c in tag.chars() {
        match quote {
            None if c == '"' || c == '\'' => quote = Some(c),
            Some(open) if c == open => quote = None,
            Some(_) if hidden(c) => {
                reference(out, c);
                continue;
            }
            _ => {}
        }
        out.push(c);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use roxmltree::Document;

    #[test]
    fn documents_keep_their_data_without_invisible_characters() {
        let text = "\u{feff}<?xml version=\"1.0\"?>\r\n<!-- a\u{202e} > b -->\n<robot name='x\u{202e}>\u{200b}'>\n\t<link name=\"1\u{9b}\"/>te\u{2066}xt<![CDATA[<\u{2028}]]></robot>";
        let safe = document(text);
        assert!(!safe[3..].contains(|c: char| !c.is_ascii()), "{safe}");
        let (before, after) = (Document::parse(text).unwrap(), Document::parse(&safe).unwrap());
        let of = |document: &Document<'_>| -> Vec<(String, Vec<(String, String)>)> {
            let own = |node: roxmltree::Node<'_, '_>| {
                let attributes = node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect();
                (node.tag_name().name().to_owned(), attributes)
            };
            document.descendants().filter(roxmltree::Node::is_element).map(own).collect()
        };
        assert_eq!(of(&before), of(&after));
        assert!(safe.contains("<!-- a\\u202e > b -->") && safe.contains("te&#x2066;xt<![CDATA[<\\u2028]]>"), "{safe}");
        let plain = "\u{feff}<robot name=\"é\">\r\n\t</robot>";
        assert!(matches!(document(plain), Cow::Borrowed(text) if text == plain));
    }

    #[test]
    fn xacro_expressions_are_escaped() {
        for safe in [escaped("${1+1}$(find a)$$({$").into_owned(), comment("${1+1}$(find a)$$({$")] {
            assert_eq!(safe, "\\u0024{1+1}\\u0024(find a)$\\u0024({$");
        }
    }

    #[test]
    fn comments_contain_no_two_hyphens() {
        assert_eq!(comment("a --> b---"), "a - -> b- - - ");
        assert_eq!(comment("a\n\u{202e}"), "a\\u000a\\u202e");
    }

    proptest! {
        #[test]
        fn readers_get_attributes_and_texts_back(text in "[^$\u{0}-\u{8}\u{b}\u{c}\u{e}-\u{1f}\u{fffe}\u{ffff}]{0,40}", note in any::<String>()) {
            let (own, note) = (escaped(&text), comment(&note));
            let document = format!("<a b=\"{own}\" c='{own}'>{own}<!--{note}--></a>");
            prop_assert!(!document.contains(is_invisible));
            let read = Document::parse(&document).unwrap();
            let root = read.root_element();
            prop_assert_eq!(root.attribute("b"), Some(&*text));
            prop_assert_eq!(root.attribute("c"), Some(&*text));
            prop_assert_eq!(root.text().unwrap_or(""), &*text);
        }

        #[test]
        fn any_text_can_be_written(text in any::<String>()) {
            let document = format!("<a b=\"{}\"/>", escaped(&text));
            prop_assert!(Document::parse(&document).is_ok());
        }

        #[test]
        fn a_document_of_any_bytes_is_no_panic(text in "[<>!?\"'\\[\\]\\-a\u{202e}\u{feff}CDATA=]{0,60}") {
            let safe = document(&text);
            prop_assert!(safe.len() >= text.len());
        }
    }
}
