//! `<collision>` of a link.

use super::UrdfError;
use super::origin::origin;
use super::values::{child, numbers, required_number};
use crate::collision::{CollisionGeometry, CollisionShape};
use crate::spatial::Transform;
use crate::xml::shortened;
use roxmltree::Node;

/// All shapes of a link, in the order of the document, and the elements without a usable shape: empty, of an unknown
/// geometry, or with invalid sizes. An invalid shape is not an error, because shapes do not influence dynamics; it
/// becomes [`CollisionGeometry::Unsupported`].
pub(super) fn shapes<'a, 'input>(link: Node<'a, 'input>) -> (Vec<CollisionShape>, Vec<Node<'a, 'input>>) {
    let (mut shapes, mut faulty) = (Vec::new(), Vec::new());
    for node in link.children().filter(|child| child.has_tag_name("collision")) {
        match shape(node) {
            Ok(Some(shape)) => shapes.push(shape),
            Ok(None) => faulty.push(node),
            Err(what) => {
                let geometry = CollisionGeometry::Unsupported { what };
                shapes.push(CollisionShape { placement: Transform::IDENTITY, geometry });
                faulty.push(node);
            }
        }
    }
    (shapes, faulty)
}

/// The shape (`None` for an empty element), or its error.
fn shape(node: Node<'_, '_>) -> Result<Option<CollisionShape>, String> {
    let Some(form) = child(node, "geometry").and_then(|node| node.children().find(Node::is_element)) else {
        return Ok(None);
    };
    let name = form.tag_name().name();
    let geometry = match geometry(form, name) {
        Ok(Some(geometry)) => geometry,
        Ok(None) => return Err(format!("`<{}>`: unknown geometry, or an attribute is missing", shortened(name))),
        Err(error) => return Err(format!("`<{}>`: {error}", shortened(name))),
    };
    let placement = origin(node, || "a collision shape".to_owned()).map_err(|error| error.to_string())?;
    Ok(Some(CollisionShape { placement, geometry }))
}

fn geometry(form: Node<'_, '_>, name: &str) -> Result<Option<CollisionGeometry>, UrdfError> {
    let size = |attribute: &'static str| required_number(form, attribute).map(f64::abs);
    Ok(match name {
        "box" => numbers::<3>(form, "size")?.map(|size_m| CollisionGeometry::Box { size_m: size_m.map(f64::abs) }),
        "cylinder" => Some(CollisionGeometry::Cylinder { radius_m: size("radius")?, length_m: size("length")? }),
        "sphere" => Some(CollisionGeometry::Sphere { radius_m: size("radius")? }),
        "capsule" => Some(CollisionGeometry::Capsule { radius_m: size("radius")?, length_m: size("length")? }),
        "mesh" => {
            let scale = numbers::<3>(form, "scale")?.unwrap_or([1.0; 3]);
            let file = form.attribute("filename").map(str::trim).filter(|file| !file.is_empty());
            file.map(|file| CollisionGeometry::Mesh { file: file.to_owned(), scale })
        }
        _ => None,
    })
}
