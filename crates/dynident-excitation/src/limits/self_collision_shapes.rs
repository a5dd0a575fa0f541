//! Self-collision as a study describes it: shapes on links, given or fitted.

use super::error::LimitError;
use super::link_points::link_place;
use super::numbers::{finite, not_negative, positive};
use dynident_model::{Model, Vec3};
use serde::{Deserialize, Serialize};

/// Distances between the arm's own links, which are taken as convex shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SelfCollision {
    /// Radius of fitted capsules, m.
    pub radius_m: f64,
    /// Least distance between surfaces, m.
    pub clearance_m: f64,
    /// Capsules in place of fitted ones, which lead from each body's origin to the origins of the joints that it
    /// carries.
    pub capsules: Vec<LinkCapsule>,
    /// Other convex shapes, beside the capsules.
    pub shapes: Vec<LinkShape>,
    /// Pairs of links that may touch, besides neighbours.
    pub ignored: Vec<[String; 2]>,
    /// Also leave out pairs that touch both in the neutral posture (every joint at zero, or as near to it as its limits
    /// allow) and in most of 256 others within the limits: links whose shapes stand in each other. Pairs that are
    /// nearer than `clearance_m` in all of these postures are left out if they touch in none, and else must not touch.
    /// Of pairs that are nearer than twice `clearance_m` in all of them, half of the largest distance is required.
    pub leave_out_touching: bool,
}

impl Default for SelfCollision {
    /// Fitted capsules of 0.06 m radius (the tube of a 5 to 15 kg arm), no extra clearance.
    fn default() -> Self {
        Self {
            radius_m: 0.06,
            clearance_m: 0.0,
            capsules: Vec::new(),
            shapes: Vec::new(),
            ignored: Vec::new(),
            leave_out_touching: false,
        }
    }
}

/// A capsule in a link's frame: all points within `radius_m` of the segment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkCapsule {
    /// Name of the link.
    pub link: String,
    /// One end of the segment, m.
    pub from_m: [f64; 3],
    /// The other end, m; equal ends make a sphere.
    pub to_m: [f64; 3],
    /// Radius, m.
    pub radius_m: f64,
}

/// A convex shape in a link's frame: all points within `radius_m` of the hull of its corners. Two corners make a
/// capsule, eight a box.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkShape {
    /// Name of the link.
    pub link: String,
    /// Corners, m; at least one.
    pub corners_m: Vec<[f64; 3]>,
    /// What is laid about their hull, m.
    #[serde(default)]
    pub radius_m: f64,
}

impl LinkShape {
    pub(crate) fn validate(&self, model: &Model, what: &str) -> Result<(), LimitError> {
        link_place(model, &self.link, what)?;
        if self.corners_m.is_empty() {
            return Err(LimitError::NoPoints { what: format!("{what} on link `{}`", self.link) });
        }
        for value in self.corners_m.iter().flatten() {
            finite(&format!("a corner of {what} on link `{}`", self.link), *value)?;
        }
        not_negative(&format!("radius of {what} on link `{}`", self.link), self.radius_m)
    }
}

impl SelfCollision {
    /// Checks numbers and names.
    ///
    /// # Errors
    /// If a link is unknown, a number is not finite, a radius or the clearance negative, or a pair has no size at all
    /// to keep apart.
    pub fn validate(&self, model: &Model) -> Result<(), LimitError> {
        not_negative("clearance of the self-collision limit", self.clearance_m)?;
        if self.fitted() {
            positive("radius of the fitted capsules", self.radius_m)?;
        }
        for capsule in &self.capsules {
            let what = format!("the capsule of link `{}`", capsule.link);
            link_place(model, &capsule.link, &what)?;
            for value in capsule.from_m.into_iter().chain(capsule.to_m) {
                finite(&format!("an end of {what}"), value)?;
            }
            positive(&format!("radius of {what}"), capsule.radius_m)?;
        }
        self.shapes.iter().try_for_each(|shape| shape.validate(model, "a shape of the self-collision limit"))?;
        for name in self.ignored.iter().flatten() {
            link_place(model, name, "the list of ignored pairs")?;
        }
        Ok(())
    }

    /// Whether capsules are fitted, since none is given.
    pub(crate) fn fitted(&self) -> bool {
        self.capsules.is_empty() && self.shapes.is_empty()
    }

    /// All shapes.
    pub(crate) fn all_shapes(&self, model: &Model) -> Vec<LinkShape> {
        if self.fitted() {
            return fitted_capsules(model, self.radius_m);
        }
        let capsules = self.capsules.iter().map(|capsule| LinkShape {
            link: capsule.link.clone(),
            corners_m: vec![capsule.from_m, capsule.to_m],
            radius_m: capsule.radius_m,
        });
        capsules.chain(self.shapes.iter().cloned()).collect()
    }
}

/// Capsules from each body's origin to the origins of the joints it carries; at a tip to the farthest fixed link, or a
/// sphere. Those of the base begin at its frame.
pub(crate) fn fitted_capsules(model: &Model, radius_m: f64) -> Vec<LinkShape> {
    (0..=model.body_count()).flat_map(|index| body_capsules(model, index.checked_sub(1), radius_m)).collect()
}

/// The fitted capsules of one body, in the frame of its first link.
pub(crate) fn body_capsules(model: &Model, body: Option<usize>, radius_m: f64) -> Vec<LinkShape> {
    let links = &body.map_or(model.base(), |body| &model.bodies()[body]).links;
    let Some(link) = links.first() else { return Vec::new() };
    let carried = model.tree_joints().iter().filter(|joint| joint.parent == body);
    let mut far: Vec<Vec3> = carried.map(|joint| joint.placement.translation).collect();
    if far.is_empty() {
        let places = links.iter().map(|link| link.placement.translation);
        far.extend(places.max_by(|a, b| a.norm().total_cmp(&b.norm())));
    }
    let own = link.placement.inverse();
    let capsule = |end: Vec3| LinkShape {
        link: link.name.clone(),
        corners_m: [Vec3::ZERO, end].map(|end| own.point(end).0).to_vec(),
        radius_m,
    };
    far.into_iter().map(capsule).collect()
}
