//! `<collision>` of a link.

use super::UrdfError;
use super::origin::origin;
use super::values::{child, numbers, required_number};
use crate::collision::{CollisionGeometry, CollisionShape};
use roxmltree::Node;

/// All shapes of a link, in the order of the document, and the elements that give none: without a known geometry, or
/// with sizes that are no sizes. A shape plays no part in dynamics, so that a faulty one is listed and not fatal.
pub(super) fn shapes<'a, 'input>(link: Node<'a, 'input>) -> (Vec<CollisionShape>, Vec<Node<'a, 'input>>) {
    let (mut shapes, mut faulty) = (Vec::new(), Vec::new());
    for node in link.children().filter(|child| child.has_tag_name("collision")) {
        match shape(node) {
            Ok(Some(shape)) => shapes.push(shape),
            Ok(None) | Err(_) => faulty.push(node),
        }
    }
    (shapes, faulty)
}

fn shape(node: Node<'_, '_>) -> Result<Option<CollisionShape>, UrdfError> {
    let Some(form) = child(node, "geometry").and_then(|node| node.children().find(Node::is_element)) else {
        return Ok(None);
    };
    let size = |attribute: &'static str| required_number(form, attribute).map(f64::abs);
    let geometry = match form.tag_name().name() {
        "box" => match numbers::<3>(form, "size")? {
            Some(size_m) => CollisionGeometry::Box { size_m: size_m.map(f64::abs) },
            None => return Ok(None),
        },
        "cylinder" => CollisionGeometry::Cylinder { radius_m: size("radius")?, length_m: size("length")? },
        "sphere" => CollisionGeometry::Sphere { radius_m: size("radius")? },
        "capsule" => CollisionGeometry::Capsule { radius_m: size("radius")?, length_m: size("length")? },
        "mesh" => match form.attribute("filename") {
            Some(file) => {
                let scale = numbers::<3>(form, "scale")?.unwrap_or([1.0; 3]);
                CollisionGeometry::Mesh { file: file.trim().to_owned(), scale }
            }
            None => return Ok(None),
        },
        _ => return Ok(None),
    };
    Ok(Some(CollisionShape { placement: origin(node, || "a collision shape".to_owned())?, geometry }))
}
