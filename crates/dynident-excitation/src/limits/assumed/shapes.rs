//! Collision shapes of a robot's links, or capsules where shapes are missing or unusable.

use super::super::error::LimitError;
use super::super::pairs::arm_length_m;
use super::super::self_collision_shapes::{LinkShape, body_capsules};
use super::AssumedLimits;
use super::closer::closer_shapes;
use super::words::listed;
use dynident_model::collision::Solid;
use dynident_model::{Link, Model};
use std::path::Path;

/// Radius of a capsule that replaces the shapes of a link, as a share of the arm's length: about the radius of the
/// tubes of a UR10 or an iiwa.
pub const CAPSULE_RADIUS_SHARE: f64 = 0.04;

/// Shapes of all links.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapesOfLinks {
    /// Shapes of the links.
    pub shapes: Vec<LinkShape>,
    /// Links with a capsule from joint to joint: all links of a robot description without shapes, and links with an
    /// unusable shape.
    pub stand_ins: Vec<String>,
    /// Links without a shape in a robot description that has shapes for other links: links with a mass, and one link
    /// of each body without shapes.
    pub without: Vec<String>,
    /// Unusable shapes, each with its link, file and reason.
    pub dropped: Vec<String>,
    solids: Vec<(String, Solid)>,
    described: bool,
}

impl ShapesOfLinks {
    /// Reads the collision shapes of the robot description in `folder`, with convex hulls of meshes. Links with an
    /// unusable shape, and all links of a robot description without shapes, get capsules from joint to joint with a
    /// radius of 4 % of the arm's length.
    pub fn of(model: &Model, folder: &Path) -> Self {
        let radius_m = CAPSULE_RADIUS_SHARE * arm_length_m(model);
        let bodies = || (0..=model.body_count()).map(|index| index.checked_sub(1));
        let links = |body: Option<usize>| &body.map_or(model.base(), |body| &model.bodies()[body]).links;
        let described = bodies().any(|body| links(body).iter().any(|link| !link.collision.is_empty()));
        let mut found = Self { described, ..Self::default() };
        for body in bodies() {
            let (before, mut unread) = (found.shapes.len(), false);
            for link in links(body) {
                for shape in &link.collision {
                    match shape.solid(folder) {
                        Ok(solid) => {
                            found.shapes.push(LinkShape::holding(&link.name, &solid));
                            found.solids.push((link.name.clone(), solid));
                        }
                        Err(error) => {
                            unread = true;
                            found.dropped.push(format!("a collision shape of link `{}`: {error}", link.name));
                        }
                    }
                }
            }
            let Some(first) = links(body).first() else { continue };
            if (!described || unread) && radius_m > 0.0 {
                found.shapes.extend(body_capsules(model, body, radius_m));
                found.stand_ins.push(first.name.clone());
            }
            if described {
                let has_mass = |link: &Link| link.inertial.is_some_and(|inertial| inertial.mass_kg() > 0.0);
                let no_shape_at_all =
                    |link: &Link| body.is_some() && found.shapes.len() == before && link.name == first.name;
                let without = links(body).iter().filter(|link| link.collision.is_empty());
                let without = without.filter(|link| has_mass(link) || no_shape_at_all(link));
                found.without.extend(without.map(|link| link.name.clone()));
            }
        }
        found
    }

    /// Shapes in which meshes with too coarse convex hulls are cut into convex pieces; also returns the links of
    /// these meshes. Hulls are too coarse if two links come closer than `clearance_m` by their hulls but not by their
    /// triangles, in the neutral posture or in more than a given share of random postures.
    ///
    /// # Errors
    /// Errors of [`Limits::validate`](super::super::description::Limits::validate) for the shapes.
    pub(super) fn refined(
        &self,
        model: &Model,
        clearance_m: f64,
        settings: &AssumedLimits,
    ) -> Result<(Vec<LinkShape>, Vec<String>), LimitError> {
        let mut shapes = self.shapes.clone();
        // A link whose unusable shape was replaced by a capsule keeps the capsule.
        let is_whole = |(link, _): &&(String, Solid)| !self.stand_ins.contains(link);
        let solids: Vec<(String, Solid)> = self.solids.iter().filter(is_whole).cloned().collect();
        let closer = closer_shapes(model, &solids, &self.shapes, clearance_m, settings)?;
        let mut links: Vec<String> = closer.iter().map(|shape| shape.link.clone()).collect();
        links.dedup();
        shapes.retain(|shape| !links.contains(&shape.link));
        shapes.extend(closer);
        Ok((shapes, links))
    }

    /// Describes the origin of the shapes; `in_pieces` are the links whose meshes are cut.
    pub(super) fn description(&self, in_pieces: &[String]) -> String {
        const CAPSULES: &str = "capsules from joint to joint with a radius of 4 % of the arm's length";
        if !self.described {
            return format!("{CAPSULES}, because the robot description has no collision shapes");
        }
        let pieces = match in_pieces {
            [] => String::new(),
            links => format!(" (convex pieces for {})", listed(links)),
        };
        let capsules = match self.stand_ins.as_slice() {
            [] => String::new(),
            links => format!("; for {} {CAPSULES}, because a shape cannot be used", listed(links)),
        };
        format!("the collision shapes of the robot description, convex hulls of meshes{pieces}{capsules}")
    }
}
