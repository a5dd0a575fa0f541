//! `<inertial>` and `<collision>` of a link.

use super::fault::{SdfError, SdfFault, fault_at};
use super::notices::{Notices, SdfLoss};
use super::scopes::Item;
use super::values::{child, children, flag, number, numbers, placement, text};
use crate::collision::{CollisionGeometry, CollisionShape};
use crate::inertial::InertialParameters;
use crate::spatial::{Mat3, Transform};
use crate::xml::shortened;
use roxmltree::Node;

/// Inertial of a link in the link's frame; `None` if the file does not contain it.
pub(super) fn inertial(link: &Item<'_, '_>, notices: &mut Notices) -> Result<Option<InertialParameters>, SdfError> {
    if flag(link.node, "gravity") == Some(false) {
        notices.note(link.node, SdfLoss::Weightless { link: link.name.clone() });
    }
    let mut unknown = |node, why| {
        notices.note(node, SdfLoss::UnknownMass { link: link.name.clone(), why });
        Ok(None)
    };
    // A link that serves only as a frame has no inertial either.
    let Some(node) = child(link.node, "inertial") else {
        return unknown(link.node, "is not stated (SDF default: 1 kg)");
    };
    if matches!(node.attribute("auto"), Some("true" | "1")) {
        return unknown(node, "depends on its collision shapes (`auto`), which is not supported");
    }
    let Some(mass) = number(node, "mass")? else {
        return unknown(node, "is not stated (SDF default: 1 kg)");
    };
    if mass < 0.0 {
        return Err(fault_at(node, SdfFault::NegativeMass { link: link.name.clone() }));
    }
    if child(node, "fluid_added_mass").is_some() {
        notices.note(node, SdfLoss::AddedMass { link: link.name.clone() });
    }
    let at_com = match child(node, "inertia") {
        Some(inertia) => {
            let moment = |name, otherwise| number(inertia, name).map(|moment| moment.unwrap_or(otherwise));
            let [xx, yy, zz] = [moment("ixx", 1.0)?, moment("iyy", 1.0)?, moment("izz", 1.0)?];
            let [xy, xz, yz] = [moment("ixy", 0.0)?, moment("ixz", 0.0)?, moment("iyz", 0.0)?];
            Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        }
        None => Mat3::IDENTITY,
    };
    let link_from_inertial = placement(node)?;
    let r = &link_from_inertial.rotation;
    // Without a rotation the numbers are not changed by rounding.
    let turned = if *r == Mat3::IDENTITY { at_com } else { r.mul_mat(&at_com).mul_mat(&r.transpose()) };
    Ok(Some(InertialParameters::from_centre_of_mass(mass, link_from_inertial.translation, &turned)))
}

/// Shapes of a link in its frame. An unknown geometry is not an error, because shapes have no influence on dynamics.
pub(super) fn shapes(link: Node<'_, '_>) -> Vec<CollisionShape> {
    let unsupported = |what: String| {
        let geometry = CollisionGeometry::Unsupported { what };
        Some(CollisionShape { placement: Transform::IDENTITY, geometry })
    };
    let of = |node| shape(node).unwrap_or_else(|error| unsupported(error.to_string()));
    children(link, "collision").filter_map(of).collect()
}

fn shape(node: Node<'_, '_>) -> Result<Option<CollisionShape>, SdfError> {
    let form = child(node, "geometry").and_then(|node| node.children().find(Node::is_element));
    let Some(form) = form else { return Ok(None) };
    let [radius, length] = [number(form, "radius")?, number(form, "length")?];
    let name = form.tag_name().name();
    let geometry = match name {
        // These geometries are not shapes of a link.
        "plane" | "heightmap" | "empty" => return Ok(None),
        "box" => numbers::<3>(form, "size")?.map(|size| CollisionGeometry::Box { size_m: size.map(f64::abs) }),
        "sphere" => radius.map(|radius| CollisionGeometry::Sphere { radius_m: radius.abs() }),
        "cylinder" => (radius.zip(length))
            .map(|(radius, length)| CollisionGeometry::Cylinder { radius_m: radius.abs(), length_m: length.abs() }),
        "capsule" => (radius.zip(length))
            .map(|(radius, length)| CollisionGeometry::Capsule { radius_m: radius.abs(), length_m: length.abs() }),
        "mesh" => {
            let scale = numbers::<3>(form, "scale")?.unwrap_or([1.0; 3]);
            let uri = child(form, "uri").map(text).filter(|uri| !uri.is_empty());
            uri.map(|uri| CollisionGeometry::Mesh { file: uri.to_owned(), scale })
        }
        _ => None,
    };
    let placement = placement(node)?;
    let what = || format!("`<{}>`: unknown geometry, or its sizes are missing", shortened(name));
    let geometry = geometry.unwrap_or_else(|| CollisionGeometry::Unsupported { what: what() });
    Ok(Some(CollisionShape { placement, geometry }))
}
