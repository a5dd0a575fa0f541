//! The shapes of a robot's links, or what stands in for them.

use super::super::pairs::arm_length_m;
use super::super::self_collision_shapes::{LinkShape, body_capsules};
use super::words::listed;
use dynident_model::Model;
use std::path::Path;

/// Radius of a capsule that stands in for a link, as a share of the arm's length: the tube of a UR10 or an iiwa.
const STAND_IN: f64 = 0.04;

/// Shapes of all links.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapesOfLinks {
    /// The shapes.
    pub shapes: Vec<LinkShape>,
    /// Links for which a capsule from joint to joint stands in: all of a description without shapes, and those whose
    /// mesh cannot be read.
    pub stand_ins: Vec<String>,
    /// Bodies without any shape in a description that has shapes elsewhere.
    pub without: Vec<String>,
    /// Why meshes could not be read.
    pub faults: Vec<String>,
    /// Whether the description has any shape.
    described: bool,
}

impl ShapesOfLinks {
    /// The collision shapes of the description, which stands in `folder`; for meshes that cannot be read, and for a
    /// description without any, capsules along the links with a radius of 4 % of the arm's length.
    pub fn of(model: &Model, folder: &Path) -> Self {
        let radius_m = STAND_IN * arm_length_m(model);
        let bodies = || (0..=model.body_count()).map(|index| index.checked_sub(1));
        let links = |body: Option<usize>| &body.map_or(model.base(), |body| &model.bodies()[body]).links;
        let described = bodies().any(|body| links(body).iter().any(|link| !link.collision.is_empty()));
        let mut found = Self { described, ..Self::default() };
        for body in bodies() {
            let (before, mut unread) = (found.shapes.len(), false);
            for link in links(body) {
                for shape in &link.collision {
                    match shape.solid(folder) {
                        Ok(solid) => found.shapes.push(LinkShape::holding(&link.name, &solid)),
                        Err(error) => {
                            unread = true;
                            found.faults.push(error.to_string());
                        }
                    }
                }
            }
            let Some(link) = links(body).first() else { continue };
            if (!described || unread) && radius_m > 0.0 {
                found.shapes.extend(body_capsules(model, body, radius_m));
                found.stand_ins.push(link.name.clone());
            } else if found.shapes.len() == before && body.is_some() {
                found.without.push(link.name.clone());
            }
        }
        found
    }

    /// Where the shapes are from.
    pub(super) fn in_words(&self) -> String {
        const CAPSULES: &str = "capsules from joint to joint with a radius of 4 % of the arm's length";
        if !self.described {
            return format!("{CAPSULES}, since the description has no collision shapes");
        }
        if self.stand_ins.is_empty() {
            return "the description's collision shapes, convex hulls of meshes".to_owned();
        }
        let why = self.faults.first().map_or("", String::as_str);
        format!("the description's collision shapes; for {} {CAPSULES} ({why})", listed(&self.stand_ins))
    }
}
