//! The document with its `<include>` elements replaced by the included files.

use super::fault::{MjcfError, MjcfFault};
use crate::place::{Located, line_and_column};
use crate::xml::{MAX_NODES, Malformed, first_excess, malformed, root_name, shortened};
use roxmltree::{Document, Node, ParsingOptions};
use std::collections::HashSet;

pub(super) const MAX_BYTES: usize = 16 << 20;

#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: String,
    pub(super) value: String,
    pub(super) place: Place,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place {
    /// Index of the file; 0 is the main file.
    pub(super) source: usize,
    pub(super) at: usize,
}

#[derive(Debug)]
pub(super) struct Element {
    pub(super) tag: String,
    pub(super) attributes: Vec<Attribute>,
    children: Vec<usize>,
    pub(super) place: Place,
}

impl Element {
    pub(super) fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|attribute| attribute.name == name)
    }
}

/// A file: name in the document, text, and place of its `<include>` (`None` for the main file).
struct Source {
    name: String,
    text: String,
    included: Option<Place>,
}

pub(super) struct Expanded {
    elements: Vec<Element>,
    sources: Vec<Source>,
}

/// Returns the text of an included file, or the reason why it cannot be read.
pub type Include<'f> = dyn FnMut(&str) -> Result<String, String> + 'f;

impl Expanded {
    /// Parses `text` and its included files, which `include` reads.
    pub(super) fn new(text: &str, include: &mut Include<'_>) -> Result<Self, MjcfError> {
        let mut found = Self { elements: Vec::new(), sources: Vec::new() };
        found.sources.push(Source { name: String::new(), text: text.to_owned(), included: None });
        let mut names = HashSet::new();
        let mut bytes = text.len();
        found.append(0, None)?;
        // Elements come before their children in the list, so that one pass finds every `<include>`, including those
        // in appended files.
        let mut next = 0;
        while next < found.elements.len() {
            let mut children = 0;
            while let Some(&child) = found.elements[next].children.get(children) {
                if found.elements[child].tag != "include" {
                    children += 1;
                    continue;
                }
                let place = found.elements[child].place;
                let Some(file) = found.elements[child].attribute("file").map(|file| file.value.clone()) else {
                    let fault = MjcfFault::MissingAttribute { element: "include".to_owned(), attribute: "file" };
                    return Err(found.fault(place, fault));
                };
                let file = file.trim().to_owned();
                if !names.insert(file.clone()) {
                    return Err(found.fault(place, MjcfFault::IncludedTwice { file: shortened(&file) }));
                }
                let text = include(&file)
                    .map_err(|reason| found.fault(place, MjcfFault::Include { file: shortened(&file), reason }))?;
                bytes += text.len();
                if bytes > MAX_BYTES {
                    return Err(found.fault(place, MjcfFault::TooLarge { limit: MAX_BYTES, what: "bytes" }));
                }
                let source = found.sources.len();
                found.sources.push(Source { name: file, text, included: Some(place) });
                let root = found.append(source, Some(place))?;
                let included = std::mem::take(&mut found.elements[root].children);
                found.elements[next].children.splice(children..=children, included);
            }
            next += 1;
        }
        Ok(found)
    }

    /// Parses a file into the arena; returns the index of its root.
    fn append(&mut self, source: usize, included: Option<Place>) -> Result<usize, MjcfError> {
        // Parsed text and arena cannot be borrowed at once.
        let text = std::mem::take(&mut self.sources[source].text);
        let parsed = self.parse(&text, source, included.is_some());
        self.sources[source].text = text;
        parsed.map_err(|(at, fault)| self.fault(Place { source, at }, fault))
    }

    fn parse(&mut self, text: &str, source: usize, is_included: bool) -> Result<usize, (usize, MjcfFault)> {
        if let Some(at) = first_excess(text) {
            return Err((at, MjcfFault::Flood));
        }
        let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options).map_err(|error| xml_fault(text, &error))?;
        let root = document.root_element();
        let name = root.tag_name().name();
        if !(name == "mujoco" || is_included && name == "mujocoinclude") {
            return Err((root.range().start, MjcfFault::NotMjcf { root: shortened(name) }));
        }
        let first = self.elements.len();
        if first + document.descendants().count() > MAX_NODES as usize {
            return Err((0, MjcfFault::TooLarge { limit: MAX_NODES as usize, what: "nodes" }));
        }
        // A stack avoids recursion, because elements may be nested as deep as the file is long.
        let mut ahead: Vec<(Node<'_, '_>, Option<usize>)> = vec![(root, None)];
        while let Some((node, parent)) = ahead.pop() {
            let index = self.elements.len();
            let attribute = |attribute: roxmltree::Attribute<'_, '_>| Attribute {
                name: attribute.name().to_owned(),
                value: attribute.value().to_owned(),
                place: Place { source, at: attribute.range_value().start },
            };
            self.elements.push(Element {
                tag: node.tag_name().name().to_owned(),
                attributes: node.attributes().map(attribute).collect(),
                children: Vec::new(),
                place: Place { source, at: node.range().start },
            });
            if let Some(parent) = parent {
                self.elements[parent].children.push(index);
            }
            let children: Vec<_> = node.children().filter(Node::is_element).collect();
            ahead.extend(children.into_iter().rev().map(|child| (child, Some(index))));
        }
        Ok(first)
    }

    pub(super) fn root(&self) -> &Element {
        &self.elements[0]
    }

    pub(super) fn children<'t>(&'t self, of: &'t Element) -> impl DoubleEndedIterator<Item = &'t Element> {
        of.children.iter().map(|&child| &self.elements[child])
    }

    /// All children of the root with this tag: a section may be repeated in MJCF.
    pub(super) fn sections<'t>(&'t self, tag: &'t str) -> impl Iterator<Item = &'t Element> {
        self.children(self.root()).filter(move |element| element.tag == tag)
    }

    /// Returns `fault` with its line and column in the main file; for an included file, the place of the `<include>`.
    pub(super) fn fault(&self, place: Place, fault: MjcfFault) -> MjcfError {
        let source = &self.sources[place.source];
        let (line, column) = line_and_column(&source.text, place.at);
        match source.included {
            None => Located { line, column, fault },
            Some(at) => {
                let (file, fault) = (shortened(&source.name), Box::new(fault));
                self.fault(at, MjcfFault::Included { file, line, column, fault })
            }
        }
    }

    /// Line of a place, with the name of its file if it is not the main file.
    pub(super) fn line(&self, place: Place) -> (Option<String>, u32) {
        let source = &self.sources[place.source];
        let line = line_and_column(&source.text, place.at).0;
        (source.included.is_some().then(|| source.name.clone()), line)
    }
}

pub(crate) fn is_mjcf(text: &str) -> bool {
    root_name(text) == Some("mujoco")
}

fn xml_fault(text: &str, error: &roxmltree::Error) -> (usize, MjcfFault) {
    let (at, why) = malformed(text, error);
    let fault = match why {
        Malformed::Doctype => MjcfFault::Doctype,
        Malformed::TooLarge => MjcfFault::TooLarge { limit: MAX_NODES as usize, what: "nodes" },
        Malformed::Markup { reason } => MjcfFault::Xml { reason },
    };
    (at, fault)
}
