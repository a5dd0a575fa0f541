//! Edits of a text that keep all other bytes: replaced and inserted elements, with the surrounding indentation.

use super::tags::start_tag_length;
use roxmltree::Node;
use std::borrow::Cow;
use std::ops::Range;

/// Replaces parts of `original`. The parts must not overlap. All other bytes are kept, except invisible characters,
/// which become references and escape sequences ([`dynident_text::xml::document`]).
pub(crate) fn edited(original: &str, mut edits: Vec<(Range<usize>, String)>) -> String {
    // An insertion comes before a replacement at the same position.
    edits.sort_by_key(|(range, _)| (range.start, range.end));
    let mut text = String::with_capacity(original.len() + edits.iter().map(|(_, new)| new.len()).sum::<usize>());
    let mut done = 0;
    for (range, new) in edits {
        text += &original[done..range.start];
        text += &new;
        done = range.end;
    }
    text += &original[done..];
    match dynident_text::xml::document(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(safe) => safe,
    }
}

/// A line of a new element, with its depth relative to the element's indentation.
pub(crate) type Line = (usize, String);

pub(crate) struct Source<'a> {
    pub(crate) text: &'a str,
    pub(crate) eol: &'a str,
}

impl<'a> Source<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self { text, eol: if text.contains("\r\n") { "\r\n" } else { "\n" } }
    }
}

impl Source<'_> {
    /// White space before `at` on its line; `None` if there is other text.
    pub(crate) fn indentation(&self, at: usize) -> Option<&str> {
        let start = self.text[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let prefix = &self.text[start..at];
        prefix.chars().all(|c| c == ' ' || c == '\t').then_some(prefix)
    }

    fn step(&self, node: Node<'_, '_>) -> String {
        let own = self.indentation(node.range().start).unwrap_or("");
        let child = node.children().find(Node::is_element).and_then(|child| self.indentation(child.range().start));
        match child.and_then(|child| child.strip_prefix(own)) {
            Some(step) if !step.is_empty() => step.to_owned(),
            // Links are children of the root, so the indentation of a link is one step.
            _ if !own.is_empty() && node.parent_element().is_some_and(|parent| parent.has_tag_name("robot")) => {
                own.to_owned()
            }
            _ => "  ".to_owned(),
        }
    }

    fn joined(&self, lines: &[Line], indentation: &str, step: &str) -> String {
        let separator = format!("{}{indentation}", self.eol);
        let lines: Vec<String> = lines.iter().map(|(depth, line)| step.repeat(*depth) + line).collect();
        lines.join(&separator)
    }

    fn compact(lines: &[Line]) -> String {
        lines.iter().map(|(_, line)| line.as_str()).collect()
    }

    /// Replaces the old element; the new one is on one line if the old one was.
    pub(crate) fn replacement(&self, old: Node<'_, '_>, lines: &[Line]) -> (Range<usize>, String) {
        let range = old.range();
        let new = match self.indentation(range.start) {
            Some(indentation) if self.text[range.clone()].contains('\n') => {
                self.joined(lines, indentation, &self.step(old))
            }
            _ => Self::compact(lines),
        };
        (range, new)
    }

    /// Inserts the new element as the first child of `node`.
    pub(crate) fn insertion_at_start(&self, node: Node<'_, '_>, lines: &[Line]) -> (Range<usize>, String) {
        let range = node.range();
        let tag = &self.text[range.clone()];
        let tag_end = range.start + start_tag_length(tag);
        let empty = self.text[..tag_end].ends_with("/>");
        let name = node.tag_name().name();
        let Some(own) = self.indentation(range.start) else {
            let new = Self::compact(lines);
            return if empty { (tag_end - 2..tag_end, format!(">{new}</{name}>")) } else { (tag_end..tag_end, new) };
        };
        let step = self.step(node);
        let inner = format!("{own}{step}");
        let new = format!("{}{inner}{}", self.eol, self.joined(lines, &inner, &step));
        if empty {
            let kept = self.text[..tag_end - 2].trim_end().len();
            return (kept..tag_end, format!(">{new}{}{own}</{name}>", self.eol));
        }
        // For `<link name="a"></link>` the end tag moves to a new line.
        let closing = if self.text[tag_end..].starts_with("</") { format!("{}{own}", self.eol) } else { String::new() };
        (tag_end..tag_end, new + &closing)
    }

    /// Range of the element, including its line if nothing else is on it.
    pub(crate) fn with_own_line(&self, node: Node<'_, '_>) -> Range<usize> {
        let range = node.range();
        let Some(indentation) = self.indentation(range.start) else { return range };
        let rest = self.text[range.end..].split('\n').next().unwrap_or("");
        if !rest.trim().is_empty() {
            return range;
        }
        let mut start = range.start - indentation.len();
        for end in ['\n', '\r'] {
            start -= usize::from(self.text[..start].ends_with(end));
        }
        start..range.end
    }
}
