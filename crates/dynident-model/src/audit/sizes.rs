//! Checks the inertia of each moving body against its size: the link length and the extent of its simple collision
//! shapes.

use super::AuditLevel::{Info, Warning};
use super::{AuditSettings, Findings, Lengths, MIN_BODY_LENGTH_M};
use crate::collision::CollisionGeometry;
use crate::spatial::{Transform, Vec3};
use crate::tree::{Body, Model};

pub(super) fn check(model: &Model, lengths: &Lengths, settings: &AuditSettings, findings: &mut Findings) {
    for (body, &length_m) in model.bodies().iter().zip(&lengths.bodies) {
        check_body(body, length_m, settings, findings);
    }
    check_base(model, findings);
}

fn check_body(body: &Body, length_m: f64, settings: &AuditSettings, findings: &mut Findings) {
    let place = format!("link {}", body.name());
    let Some((prior, inertia)) = body.prior().and_then(|prior| Some((prior, prior.inertia_at_com()?))) else { return };
    let square = 0.5 * (0..3).map(|k| inertia.0[k][k]).sum::<f64>() / prior.mass_kg();
    // If the inertia of a body is implausible, another finding already names the likely unit.
    let is_known = findings.0.iter().any(|finding| {
        finding.place == place
            && matches!(finding.check, "inertia-too-large" | "inertia-too-small" | "mass-not-positive")
    });
    if is_known || !(square > 0.0 && square.is_finite()) {
        return;
    }
    let (shapes_m, is_complete) = shape_diagonal(body);
    let size_m = shapes_m.max(length_m);
    let is_sized = is_complete && shapes_m > 0.0 || length_m > MIN_BODY_LENGTH_M;
    let check = "inertia-against-size";
    if is_sized && square > (settings.max_gyration_sizes * size_m).powi(2) {
        let message = format!(
            "has a radius of gyration of {:.3} m, more than its size of {size_m:.3} m: all its mass would be at its ends and beyond; \
             check the moments of inertia and the mass",
            square.sqrt()
        );
        findings.add(Warning, check, place, message);
    } else if square < settings.min_box_inertia_share * shapes_m.powi(2) / 12.0 {
        let message = format!(
            "has {:.1} times less inertia than a uniform box around its collision shapes ({shapes_m:.3} m from corner to corner): \
             check the moments of inertia, the mass, and the size of the shapes",
            shapes_m.powi(2) / 12.0 / square
        );
        findings.add(Warning, check, place, message);
    }
}

/// Diagonal of the box around the boxes, cylinders, spheres and capsules of a body, m, and whether the body has no
/// other shapes. Meshes are not read.
fn shape_diagonal(body: &Body) -> (f64, bool) {
    let (mut low, mut high, mut is_complete) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3], true);
    for link in &body.links {
        for shape in &link.collision {
            let half = match shape.geometry {
                CollisionGeometry::Box { size_m } => size_m.map(|size| 0.5 * size),
                CollisionGeometry::Cylinder { radius_m, length_m } => [radius_m, radius_m, 0.5 * length_m],
                CollisionGeometry::Sphere { radius_m } => [radius_m; 3],
                CollisionGeometry::Capsule { radius_m, length_m } => [radius_m, radius_m, 0.5 * length_m + radius_m],
                CollisionGeometry::Mesh { .. } | CollisionGeometry::Unsupported { .. } => {
                    is_complete = false;
                    continue;
                }
            };
            let body_from_shape: Transform = link.placement.then(&shape.placement);
            for corner in 0..8_usize {
                let sign = |axis: usize| if corner >> axis & 1 == 0 { -half[axis] } else { half[axis] };
                let point = body_from_shape.point(Vec3([sign(0), sign(1), sign(2)]));
                for axis in 0..3 {
                    low[axis] = low[axis].min(point[axis]);
                    high[axis] = high[axis].max(point[axis]);
                }
            }
        }
    }
    let diagonal = (Vec3(high) - Vec3(low)).norm();
    if diagonal.is_finite() { (diagonal, is_complete) } else { (0.0, is_complete) }
}

/// Reports a fixed base with mass that carries several limbs: robots with legs or wheels do not have a fixed base.
fn check_base(model: &Model, findings: &mut Findings) {
    let limbs = model.tree_joints().iter().filter(|joint| joint.parent.is_none()).count();
    let mass: f64 = model.base().links.iter().filter_map(|link| link.inertial).map(|inertial| inertial.mass_kg()).sum();
    if limbs >= 2 && mass > 0.0 {
        let message = format!(
            "is the base, with {mass:.3} kg and {limbs} chains of joints, and is taken as fixed to the world: for a robot on legs, wheels \
             or floats use only logs in which this link stands still, and give its orientation (base_rpy_rad)"
        );
        findings.add(Info, "base-fixed", format!("link {}", model.base().name()), message);
    }
}
