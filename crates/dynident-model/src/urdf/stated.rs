//! The numbers of `<inertial>` in a URDF, and changes of single numbers in place.

use super::origin::origin;
use super::prefixes::without_undeclared;
use super::values::{child, required_child, required_number};
use super::{UrdfError, UrdfWriteError, parse};
use crate::spatial::{Mat3, Vec3};
use crate::xml::edit::edited;
use roxmltree::Node;
use std::ops::Range;

/// Names of the six moments in a URDF, in the order of [`StatedInertial::moments`].
pub const MOMENT_NAMES: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// The numbers of the `<inertial>` of one link.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedInertial {
    /// Name of the link.
    pub link: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link's frame, m: `xyz` of `<origin>`.
    pub com_m: [f64; 3],
    /// `link_from_inertial`: rotation of the axes in which the moments are given.
    pub axes: Mat3,
    /// Moments about the centre of mass, kg m², in the order [`MOMENT_NAMES`].
    pub moments: [f64; 6],
}

impl StatedInertial {
    /// Inertia about the centre of mass in the axes of `<origin>`.
    pub fn inertia(&self) -> Mat3 {
        let [xx, xy, xz, yy, yz, zz] = self.moments;
        Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    }
}

/// The six moments of `<inertia>`, in the order of [`MOMENT_NAMES`].
pub(super) fn stated_moments(element: Node<'_, '_>) -> Result<[f64; 6], UrdfError> {
    let mut moments = [0.0; 6];
    for (moment, attribute) in moments.iter_mut().zip(MOMENT_NAMES) {
        *moment = required_number(element, attribute)?;
    }
    Ok(moments)
}

/// All `<inertial>` elements of a URDF, in the order of the document.
///
/// # Errors
/// Those of [`read_urdf`](super::read_urdf) for inertials.
pub fn stated_inertials(text: &str) -> Result<Vec<StatedInertial>, UrdfError> {
    const HINT: &str = "";
    let (regular, _) = without_undeclared(text);
    let document = parse(&regular)?;
    let mut stated = Vec::new();
    for link in document.root_element().children().filter(|node| node.has_tag_name("link")) {
        let (Some(name), Some(inertial)) = (link.attribute("name"), child(link, "inertial")) else { continue };
        let place = origin(inertial, || format!("the inertial of link `{name}`"))?;
        let Vec3(com_m) = place.translation;
        stated.push(StatedInertial {
            link: name.to_owned(),
            mass_kg: required_number(required_child(inertial, name, "inertial", "mass", HINT)?, "value")?,
            com_m,
            axes: place.rotation,
            moments: stated_moments(required_child(inertial, name, "inertial", "inertia", HINT)?)?,
        });
    }
    Ok(stated)
}

/// Writes the numbers of `<inertial>` that differ between `from` and `to` into `original` and keeps all other bytes.
/// `from` contains the [`stated_inertials`] of `original`, `to` the same links in the same order. If only the sign of
/// a number changes, its digits are kept; other numbers have the shortest form that parses to the same `f64`.
///
/// # Errors
/// An invalid original, a link of `to` that is not in it, or a number that is not finite.
pub fn rewrite_inertials(
    original: &str,
    from: &[StatedInertial],
    to: &[StatedInertial],
) -> Result<String, UrdfWriteError> {
    let (regular, _) = without_undeclared(original);
    let document = parse(&regular)?;
    let robot = document.root_element();
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    for (old, new) in from.iter().zip(to).filter(|(old, new)| old != new) {
        let unknown = || UrdfWriteError::Unknown { kind: "link", name: new.link.clone() };
        let link = robot.children().find(|node| node.has_tag_name("link") && node.attribute("name") == Some(&new.link));
        let inertial = link.and_then(|link| child(link, "inertial")).ok_or_else(unknown)?;
        let numbers = |of: &StatedInertial| of.com_m.into_iter().chain(of.moments).chain([of.mass_kg]).collect();
        let new_numbers: Vec<f64> = numbers(new);
        if old.link != new.link || new_numbers.iter().any(|number| !number.is_finite()) {
            return Err(UrdfWriteError::NotFinite { kind: "link", name: new.link.clone() });
        }
        let mut change =
            |element: &str, attribute: &str, word: usize, old: f64, new: f64| -> Result<(), UrdfWriteError> {
                if old == new {
                    return Ok(());
                }
                let place = child(inertial, element).and_then(|node| word_range(original, node, attribute, word));
                let place = place.ok_or_else(unknown)?;
                let digits = &original[place.clone()];
                let text = match digits.strip_prefix('-') {
                    Some(digits) if new == -old => digits.to_owned(),
                    None if new == -old => format!("-{}", digits.trim_start_matches('+')),
                    _ => format!("{new:?}"),
                };
                edits.push((place, text));
                Ok(())
            };
        change("mass", "value", 0, old.mass_kg, new.mass_kg)?;
        for axis in 0..3 {
            change("origin", "xyz", axis, old.com_m[axis], new.com_m[axis])?;
        }
        for (moment, name) in MOMENT_NAMES.into_iter().enumerate() {
            change("inertia", name, 0, old.moments[moment], new.moments[moment])?;
        }
    }
    Ok(edited(original, edits))
}

/// Byte range of word number `word` of an attribute.
fn word_range(text: &str, node: Node<'_, '_>, attribute: &str, word: usize) -> Option<Range<usize>> {
    let range = node.attribute_node(attribute)?.range_value();
    let value = &text[range.clone()];
    let found = value.split_ascii_whitespace().nth(word)?;
    let start = range.start + (found.as_ptr().addr() - value.as_ptr().addr());
    Some(start..start + found.len())
}
