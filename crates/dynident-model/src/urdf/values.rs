//! Names and numbers in attributes.

use super::{MAX_MAGNITUDE, UrdfError, UrdfFault, fault_at};
use crate::place::Located;
use crate::xml::{parse_number, shortened};
use roxmltree::{Attribute, Node};

/// The first child called `element`. Repetitions are reported as ignored, because the reference parser of URDF
/// ignores them, too.
pub(super) fn child<'a, 'input>(node: Node<'a, 'input>, element: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.has_tag_name(element))
}

pub(super) fn required_child<'a, 'input>(
    node: Node<'a, 'input>,
    owner: &str,
    parent: &'static str,
    element: &'static str,
    hint: &'static str,
) -> Result<Node<'a, 'input>, UrdfError> {
    child(node, element)
        .ok_or_else(|| fault_at(node, UrdfFault::MissingElement { parent, owner: owner.to_owned(), element, hint }))
}

pub(super) fn name<'a>(node: Node<'a, '_>, attribute: &'static str) -> Result<&'a str, UrdfError> {
    let element = || node.tag_name().name().to_owned();
    let found = node
        .attribute_node(attribute)
        .ok_or_else(|| fault_at(node, UrdfFault::MissingAttribute { element: element(), attribute }))?;
    refuse_xacro(node, found)?;
    if found.value().trim().is_empty() {
        return Err(fault_in(node, found, UrdfFault::EmptyName { element: element(), attribute }));
    }
    Ok(found.value())
}

/// Reads `N` numbers separated by spaces, each of at most [`MAX_MAGNITUDE`]; `None` without the attribute.
pub(super) fn numbers<const N: usize>(node: Node<'_, '_>, attribute: &str) -> Result<Option<[f64; N]>, UrdfError> {
    let Some(found) = node.attribute_node(attribute) else { return Ok(None) };
    refuse_xacro(node, found)?;
    let words = found.value().split_ascii_whitespace();
    let count = words.clone().count();
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = parse_number(word).map_err(|(fault, fix)| number_fault(node, found, word, fault, fix))?;
        if number.abs() > MAX_MAGNITUDE {
            let fix = "a value below 1e9 in m, rad, kg or kg m^2";
            return Err(number_fault(node, found, word, "too large for a robot", fix));
        }
    }
    if count != N {
        let fault = UrdfFault::Count {
            element: node.tag_name().name().to_owned(),
            attribute: attribute.to_owned(),
            expected: N,
            found: count,
        };
        return Err(fault_in(node, found, fault));
    }
    Ok(Some(numbers))
}

/// Reads one finite number of any magnitude (limits such as `1e16` mean "unlimited"); `None` without the attribute.
pub(super) fn number(node: Node<'_, '_>, attribute: &str) -> Result<Option<f64>, UrdfError> {
    let Some(found) = node.attribute_node(attribute) else { return Ok(None) };
    refuse_xacro(node, found)?;
    let word = found.value().trim();
    parse_number(word).map(Some).map_err(|(fault, fix)| number_fault(node, found, word, fault, fix))
}

pub(super) fn required_number(node: Node<'_, '_>, attribute: &'static str) -> Result<f64, UrdfError> {
    numbers::<1>(node, attribute)?.map(|[number]| number).ok_or_else(|| {
        fault_at(node, UrdfFault::MissingAttribute { element: node.tag_name().name().to_owned(), attribute })
    })
}

fn refuse_xacro(node: Node<'_, '_>, attribute: Attribute<'_, '_>) -> Result<(), UrdfError> {
    let value = attribute.value();
    if value.contains("${") || value.contains("$(") {
        return Err(fault_in(node, attribute, UrdfFault::Xacro { what: shortened(value) }));
    }
    Ok(())
}

fn number_fault(
    node: Node<'_, '_>,
    attribute: Attribute<'_, '_>,
    word: &str,
    fault: &'static str,
    fix: &'static str,
) -> UrdfError {
    let fault = UrdfFault::Number {
        element: node.tag_name().name().to_owned(),
        attribute: attribute.name().to_owned(),
        text: shortened(word),
        fault,
        fix,
    };
    fault_in(node, attribute, fault)
}

fn fault_in(node: Node<'_, '_>, attribute: Attribute<'_, '_>, fault: UrdfFault) -> UrdfError {
    let at = node.document().text_pos_at(attribute.range_value().start);
    Located { line: at.row, column: at.col, fault }
}
