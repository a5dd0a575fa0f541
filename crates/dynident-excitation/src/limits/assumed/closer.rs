//! Convex pieces instead of convex hulls, for links whose hulls come closer to each other than their meshes.

use super::super::error::LimitError;
use super::super::link_points::link_place;
use super::super::pairs::{neutral_posture, random_postures};
use super::super::pieces::convex_pieces;
use super::super::self_collision_shapes::{LinkShape, SelfCollision};
use super::super::solids::solid_distance;
use super::super::surface::Surface;
use super::{AssumedLimits, AssumptionThresholds};
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::collision::Solid;
use dynident_model::{Model, Transform, Vec3};

const POSTURES: usize = 256;

/// Maximum distance by which the pieces extend beyond the mesh, as a share of the clearance.
const MAX_RELATIVE_GAP: f64 = 0.1;

/// Convex pieces of the links that need them. `solids` are the shapes of all links, `hulls` their simplified forms.
pub(super) fn closer_shapes(
    model: &Model,
    solids: &[(String, Solid)],
    hulls: &[LinkShape],
    clearance_m: f64,
    settings: &AssumedLimits,
) -> Result<Vec<LinkShape>, LimitError> {
    let gap_m = MAX_RELATIVE_GAP * clearance_m;
    let mut closer = Vec::new();
    for link in links_too_coarse(model, solids, hulls, clearance_m, &settings.thresholds)? {
        for (_, solid) in solids.iter().filter(|(name, _)| *name == link) {
            if solid.triangles.is_empty() {
                closer.push(LinkShape::holding(&link, solid));
                continue;
            }
            let corner = |place: &u32| solid.corners_m[*place as usize];
            let triangles = solid.triangles.iter().map(|[a, b, c]| [a, b, c].map(corner)).collect();
            for piece in convex_pieces(triangles, settings.mesh_pieces) {
                closer.push(LinkShape::closely(&link, &piece, solid.radius_m, gap_m));
            }
        }
    }
    Ok(closer)
}

/// Links with meshes whose hulls violate the clearance although the meshes do not, in the order of the shapes.
fn links_too_coarse(
    model: &Model,
    solids: &[(String, Solid)],
    hulls: &[LinkShape],
    clearance_m: f64,
    thresholds: &AssumptionThresholds,
) -> Result<Vec<String>, LimitError> {
    let has_mesh = |link: &str| solids.iter().any(|(name, solid)| name == link && !solid.triangles.is_empty());
    let limit = SelfCollision { clearance_m, shapes: hulls.to_vec(), ..SelfCollision::default() };
    let resolved = limit.resolve(model)?;
    let surfaces = resolved.solids.iter().map(|solid| surface(model, &solid.link, solids, hulls));
    let surfaces = surfaces.collect::<Result<Vec<Surface>, LimitError>>()?;
    let mut workspace = Workspace::new(model);
    let postures = core::iter::once(neutral_posture(model)).chain(random_postures(model, POSTURES));
    let postures: Vec<Vec<Transform>> = postures.map(|q| body_placements(model, &mut workspace, &q).to_vec()).collect();
    let is_too_coarse = |[a, b]: [usize; 2]| {
        let mut wrong = 0;
        let mut guesses = Vec::new();
        for (number, placements) in postures.iter().enumerate() {
            let at =
                [a, b].map(|place| resolved.solids[place].body.map_or(Transform::IDENTITY, |body| placements[body]));
            let (first, second) = ((&resolved.solids[a], &at[0]), (&resolved.solids[b], &at[1]));
            if solid_distance(first.0, first.1, second.0, second.1, clearance_m, &mut guesses).surface_m >= clearance_m
                || surfaces[a].is_within(&at[0], &surfaces[b], &at[1], clearance_m)
            {
                continue;
            }
            wrong += 1;
            if number == 0 || f64::from(wrong) > thresholds.max_hull_only_share * POSTURES as f64 {
                return true;
            }
        }
        false
    };
    let mut coarse = vec![false; resolved.solids.len()];
    for pair in &resolved.pairs {
        let [a, b] = pair.of;
        let meshes = [a, b].map(|place| has_mesh(&resolved.solids[place].link));
        let known = [a, b].iter().zip(meshes).all(|(place, mesh)| coarse[*place] || !mesh);
        if (meshes[0] || meshes[1]) && !known && is_too_coarse(pair.of) {
            coarse[a] |= meshes[0];
            coarse[b] |= meshes[1];
        }
    }
    let coarse = resolved.solids.iter().zip(coarse).filter(|(_, coarse)| *coarse);
    Ok(coarse.map(|(solid, _)| solid.link.clone()).collect())
}

/// Surface of a link in the frame of its body: its solids, or its capsules if it has no solid.
fn surface(model: &Model, link: &str, solids: &[(String, Solid)], hulls: &[LinkShape]) -> Result<Surface, LimitError> {
    let (_, body_from_link) = link_place(model, link, "a collision shape")?;
    let own = solids.iter().filter(|(name, _)| name == link).map(|(_, solid)| solid.placed(&body_from_link));
    let mut own: Vec<Solid> = own.collect();
    if own.is_empty() {
        let shapes = hulls.iter().filter(|shape| shape.link == link).map(|shape| Solid {
            corners_m: shape.corners_m.iter().map(|corner| body_from_link.point(Vec3(*corner))).collect(),
            radius_m: shape.radius_m,
            triangles: Vec::new(),
        });
        own.extend(shapes);
    }
    Ok(Surface::new(&own))
}
