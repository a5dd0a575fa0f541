//! Free joints: objects of a scene, which are not read, and robots with a floating base, which are read as fixed.

use super::classes::{ClassId, Classes, Stated};
use super::expanded::{Element, Expanded};
use super::fault::MjcfError;
use std::collections::HashSet;

/// Attributes of an actuator (or of an element in a tendon) that name the joint or site on which it acts.
const TARGETS: [&str; 6] = ["joint", "jointinparent", "site", "cranksite", "slidersite", "refsite"];

/// Names of joints and sites that an actuator acts on, directly or by a tendon.
pub(super) struct ActuatedNames<'t>(HashSet<&'t str>);

impl<'t> ActuatedNames<'t> {
    pub(super) fn new(document: &'t Expanded) -> Self {
        let (mut names, mut tendons) = (HashSet::new(), HashSet::new());
        let of =
            |element: &'t Element| TARGETS.iter().filter_map(|key| element.attribute(key)).map(|name| &*name.value);
        for element in document.sections("actuator").flat_map(|section| document.children(section)) {
            names.extend(of(element));
            tendons.extend(element.attribute("tendon").map(|name| &*name.value));
        }
        for tendon in document.sections("tendon").flat_map(|section| document.children(section)) {
            if tendon.attribute("name").is_some_and(|name| tendons.contains(&*name.value)) {
                names.extend(document.children(tendon).flat_map(of));
            }
        }
        Self(names)
    }

    /// Whether a body with a free joint is an object of the scene: it has no joints below it, or no actuator moves
    /// them. In a document without actuators, every body with joints is treated as a robot.
    pub(super) fn is_object(&self, document: &'t Expanded, body: &'t Element) -> bool {
        let below = below(document, body);
        let is_joint = |element: &&Element| {
            element.tag == "joint" && element.attribute("type").is_none_or(|kind| kind.value.trim() != "free")
        };
        if !below.iter().any(is_joint) {
            return true;
        }
        let named = |element: &&Element| element.attribute("name").is_some_and(|name| self.0.contains(&*name.value));
        !self.0.is_empty() && !below.iter().any(named)
    }
}

/// Names of an object that is not read: its bodies and joints, which other sections can still name.
#[derive(Default)]
pub(super) struct Dropped {
    pub(super) bodies: HashSet<String>,
    pub(super) joints: HashSet<String>,
}

impl Dropped {
    pub(super) fn add(&mut self, document: &Expanded, body: &Element) {
        for element in below(document, body).into_iter().chain([body]) {
            let Some(name) = element.attribute("name").map(|name| name.value.clone()) else { continue };
            match element.tag.as_str() {
                "body" => drop(self.bodies.insert(name)),
                "joint" | "freejoint" => drop(self.joints.insert(name)),
                _ => {}
            }
        }
    }
}

/// All elements inside a body.
fn below<'t>(document: &'t Expanded, body: &'t Element) -> Vec<&'t Element> {
    let mut found: Vec<&Element> = document.children(body).collect();
    let mut next = 0;
    while next < found.len() {
        found.extend(document.children(found[next]));
        next += 1;
    }
    found
}

/// The free joint of a body, also if it is inside a `<frame>` element; `class` is the class of the body's elements.
pub(super) fn free_joint<'t>(
    document: &'t Expanded,
    classes: &'t Classes<'t>,
    body: &'t Element,
    class: ClassId,
) -> Result<Option<&'t Element>, MjcfError> {
    let mut ahead: Vec<(&Element, ClassId)> = document.children(body).map(|child| (child, class)).collect();
    while let Some((element, class)) = ahead.pop() {
        match element.tag.as_str() {
            "frame" => {
                let class = classes.named(document, element, "childclass")?.unwrap_or(class);
                ahead.extend(document.children(element).map(|child| (child, class)));
            }
            "freejoint" => return Ok(Some(element)),
            "joint" if is_free(&classes.stated(document, element, class)?) => return Ok(Some(element)),
            _ => {}
        }
    }
    Ok(None)
}

pub(super) fn is_free(joint: &Stated<'_>) -> bool {
    joint.get("type").is_some_and(|kind| kind.value.trim() == "free")
}
