//! `<default>`: default attributes by class.

use super::expanded::{Attribute, Element, Expanded, Place};
use super::fault::{MjcfError, MjcfFault};
use crate::xml::shortened;
use std::collections::HashMap;

/// Elements of actuators: all share one set of defaults.
const ACTUATORS: [&str; 11] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
];

pub(super) type ClassId = usize;

/// Class of elements that do not name a class.
pub(super) const MAIN: ClassId = 0;

struct Class<'t> {
    parent: Option<ClassId>,
    /// Attributes by kind of element; if an attribute is repeated, the last one applies.
    attributes: HashMap<&'static str, Vec<&'t Attribute>>,
}

pub(super) struct Classes<'t> {
    classes: Vec<Class<'t>>,
    by_name: HashMap<&'t str, ClassId>,
}

/// Elements that are read with their defaults.
fn kind_of(tag: &str) -> Option<&'static str> {
    match tag {
        "joint" => Some("joint"),
        "geom" => Some("geom"),
        "mesh" => Some("mesh"),
        _ if ACTUATORS.contains(&tag) => Some("actuator"),
        _ => None,
    }
}

impl<'t> Classes<'t> {
    pub(super) fn new(document: &'t Expanded) -> Result<Self, MjcfError> {
        let main = Class { parent: None, attributes: HashMap::new() };
        let mut found = Self { classes: vec![main], by_name: HashMap::from([("main", MAIN)]) };
        for section in document.sections("default") {
            if let Some(class) = section.attribute("class").filter(|class| class.value != "main") {
                let fault = MjcfFault::Word {
                    element: "default".to_owned(),
                    attribute: "class".to_owned(),
                    text: shortened(&class.value),
                    expected: "`main`, or none, at the top level",
                };
                return Err(document.fault(class.place, fault));
            }
            let mut ahead: Vec<(&Element, ClassId)> = vec![(section, MAIN)];
            while let Some((element, class)) = ahead.pop() {
                for child in document.children(element) {
                    if child.tag == "default" {
                        ahead.push((child, found.nested(document, child, class)?));
                    } else if let Some(kind) = kind_of(&child.tag) {
                        let known = found.classes[class].attributes.entry(kind).or_default();
                        for attribute in &child.attributes {
                            known.retain(|other| other.name != attribute.name);
                            known.push(attribute);
                        }
                    }
                }
            }
        }
        Ok(found)
    }

    fn nested(&mut self, document: &Expanded, element: &'t Element, parent: ClassId) -> Result<ClassId, MjcfError> {
        let missing = || MjcfFault::MissingAttribute { element: "default".to_owned(), attribute: "class" };
        let name = element.attribute("class").ok_or_else(|| document.fault(element.place, missing()))?;
        let class = self.classes.len();
        if self.by_name.insert(&name.value, class).is_some() {
            let fault = MjcfFault::DuplicateName { kind: "default class", name: shortened(&name.value) };
            return Err(document.fault(name.place, fault));
        }
        self.classes.push(Class { parent: Some(parent), attributes: HashMap::new() });
        Ok(class)
    }

    /// Class named by an attribute (`class`, `childclass`) of an element.
    pub(super) fn named(
        &self,
        document: &Expanded,
        element: &Element,
        attribute: &str,
    ) -> Result<Option<ClassId>, MjcfError> {
        let Some(name) = element.attribute(attribute) else { return Ok(None) };
        let unknown = || document.fault(name.place, MjcfFault::UnknownClass { class: shortened(&name.value) });
        self.by_name.get(&*name.value).copied().map(Some).ok_or_else(unknown)
    }

    /// Attributes of an element: first those in the element, then those of its class (`class`, or `childclass` of a
    /// surrounding body), then those of the parent classes.
    pub(super) fn stated(
        &'t self,
        document: &'t Expanded,
        element: &'t Element,
        childclass: ClassId,
    ) -> Result<Stated<'t>, MjcfError> {
        let class = self.named(document, element, "class")?.unwrap_or(childclass);
        let mut levels = vec![element.attributes.iter().collect::<Vec<_>>()];
        if let Some(kind) = kind_of(&element.tag) {
            let mut at = Some(class);
            while let Some(class) = at {
                levels.extend(self.classes[class].attributes.get(kind).cloned());
                at = self.classes[class].parent;
            }
        }
        Ok(Stated { document, tag: &element.tag, place: element.place, levels })
    }
}

pub(super) struct Stated<'t> {
    pub(super) document: &'t Expanded,
    pub(super) tag: &'t str,
    pub(super) place: Place,
    levels: Vec<Vec<&'t Attribute>>,
}

impl<'t> Stated<'t> {
    pub(super) fn own(document: &'t Expanded, element: &'t Element) -> Self {
        let levels = vec![element.attributes.iter().collect()];
        Self { document, tag: &element.tag, place: element.place, levels }
    }

    pub(super) fn own_attributes(&self) -> impl Iterator<Item = &'t Attribute> {
        self.levels[0].iter().copied()
    }

    pub(super) fn get(&self, name: &str) -> Option<&'t Attribute> {
        self.levels.iter().flatten().find(|attribute| attribute.name == name).copied()
    }

    /// Attributes among `names` from the nearest level (element or class) that has any of them. An orientation of a
    /// nearer level overrides one in another notation.
    pub(super) fn nearest(&self, names: &[&'static str]) -> Vec<(&'static str, &'t Attribute)> {
        let of = |level: &Vec<&'t Attribute>| -> Vec<(&'static str, &'t Attribute)> {
            names
                .iter()
                .filter_map(|&name| level.iter().find(|attribute| attribute.name == name).map(|&found| (name, found)))
                .collect()
        };
        self.levels.iter().map(of).find(|found| !found.is_empty()).unwrap_or_default()
    }
}
