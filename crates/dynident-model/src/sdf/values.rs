//! Numbers, keywords and poses in elements.

use super::fault::{SdfError, SdfFault, fault_at};
use crate::spatial::{Mat3, Transform, Vec3};
use crate::urdf::MAX_MAGNITUDE;
use crate::xml::{parse_number, shortened};
use roxmltree::Node;

pub(super) fn children<'a, 'input>(node: Node<'a, 'input>, element: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    node.children().filter(move |child| child.has_tag_name(element))
}

pub(super) fn child<'a, 'input>(node: Node<'a, 'input>, element: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.has_tag_name(element))
}

fn tag(node: Node<'_, '_>) -> String {
    node.tag_name().name().to_owned()
}

pub(super) fn text<'a>(node: Node<'a, '_>) -> &'a str {
    node.text().unwrap_or("").trim()
}

pub(super) fn required_text<'a>(node: Node<'a, '_>, element: &'static str) -> Result<&'a str, SdfError> {
    let found = child(node, element).map(text).filter(|text| !text.is_empty());
    found.ok_or_else(|| fault_at(node, SdfFault::Missing { element: tag(node), kind: "element", name: element }))
}

pub(super) fn word_of<'a>(node: Node<'a, '_>, attribute: &'static str) -> Result<&'a str, SdfError> {
    let found = node.attribute(attribute).filter(|value| !value.trim().is_empty());
    found.ok_or_else(|| fault_at(node, SdfFault::Missing { element: tag(node), kind: "attribute", name: attribute }))
}

/// Reads numbers of any magnitude, including `inf`.
fn list(node: Node<'_, '_>) -> Result<Vec<f64>, SdfError> {
    let number = |word: &str| match word.trim_start_matches('+').to_ascii_lowercase().as_str() {
        "inf" | "infinity" => Ok(f64::INFINITY),
        "-inf" | "-infinity" => Ok(f64::NEG_INFINITY),
        _ => parse_number(word).map_err(|(fault, fix)| {
            fault_at(node, SdfFault::Number { element: tag(node), text: shortened(word), fault, fix })
        }),
    };
    text(node).split_ascii_whitespace().map(number).collect()
}

/// Reads `N` numbers, each within the magnitude limit.
pub(super) fn numbers_in<const N: usize>(node: Node<'_, '_>) -> Result<[f64; N], SdfError> {
    let found = list(node)?;
    if found.len() != N {
        return Err(fault_at(node, SdfFault::Count { element: tag(node), expected: N, found: found.len() }));
    }
    if let Some(large) = found.iter().find(|number| number.abs() > MAX_MAGNITUDE) {
        let fault = SdfFault::Number {
            element: tag(node),
            text: format!("{large:e}"),
            fault: "too large for a robot",
            fix: "a value below 1e9 in m, rad, kg or kg m^2",
        };
        return Err(fault_at(node, fault));
    }
    Ok(core::array::from_fn(|k| found[k]))
}

pub(super) fn numbers<const N: usize>(node: Node<'_, '_>, element: &str) -> Result<Option<[f64; N]>, SdfError> {
    child(node, element).map(numbers_in).transpose()
}

pub(super) fn number(node: Node<'_, '_>, element: &str) -> Result<Option<f64>, SdfError> {
    Ok(numbers::<1>(node, element)?.map(|[number]| number))
}

pub(super) fn number_of_any_size(node: Node<'_, '_>, element: &str) -> Result<Option<f64>, SdfError> {
    let Some(node) = child(node, element) else { return Ok(None) };
    match list(node)?[..] {
        [number] => Ok(Some(number)),
        ref other => Err(fault_at(node, SdfFault::Count { element: tag(node), expected: 1, found: other.len() })),
    }
}

/// Value of the child `element`: `true`, `1`, `false` or `0`.
pub(super) fn flag(node: Node<'_, '_>, element: &str) -> Option<bool> {
    child(node, element).map(|node| matches!(text(node), "true" | "1"))
}

/// Pose of an element from its `<pose>`; the identity if it has none.
pub(super) fn placement(node: Node<'_, '_>) -> Result<Transform, SdfError> {
    let Some(pose) = child(node, "pose") else { return Ok(Transform::IDENTITY) };
    // An empty pose is treated as missing.
    if text(pose).is_empty() {
        return Ok(Transform::IDENTITY);
    }
    let in_degrees = matches!(pose.attribute("degrees"), Some("true" | "1"));
    match pose.attribute("rotation_format").unwrap_or("euler_rpy") {
        "euler_rpy" => {
            let [x, y, z, roll, pitch, yaw] = numbers_in::<6>(pose)?;
            let angle = |value: f64| if in_degrees { value.to_radians() } else { value };
            let rotation = Mat3::from_roll_pitch_yaw(angle(roll), angle(pitch), angle(yaw));
            Ok(Transform { rotation, translation: Vec3([x, y, z]) })
        }
        "quat_xyzw" => {
            let [x, y, z, a, b, c, d] = numbers_in::<7>(pose)?;
            let norm = [a, b, c, d].iter().map(|part| part * part).sum::<f64>().sqrt();
            if norm < 1e-9 {
                let fault = SdfFault::Number {
                    element: "pose".to_owned(),
                    text: "0 0 0 0".to_owned(),
                    fault: "no quaternion",
                    fix: "x y z w of length one, such as `0 0 0 1`",
                };
                return Err(fault_at(pose, fault));
            }
            let rotation = Mat3::from_quaternion([a, b, c, d].map(|part| part / norm));
            Ok(Transform { rotation, translation: Vec3([x, y, z]) })
        }
        other => {
            let expected = "euler_rpy or quat_xyzw as `rotation_format`";
            Err(fault_at(pose, SdfFault::Word { element: "pose".to_owned(), text: shortened(other), expected }))
        }
    }
}
