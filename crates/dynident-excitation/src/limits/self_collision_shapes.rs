//! Self-collision limits as a study describes them: shapes on links, given or fitted.

use super::error::LimitError;
use super::link_points::link_place;
use super::numbers::{finite, not_negative, positive};
use dynident_model::{Model, Vec3};
use serde::{Deserialize, Serialize};

/// Distances between the arm's own links, which are modelled as convex shapes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SelfCollision {
    /// Radius of fitted capsules, m.
    pub radius_m: f64,
    /// Minimum distance between surfaces, m.
    pub clearance_m: f64,
    /// Capsules that replace fitted ones. A fitted capsule extends from a body's origin to the origin of a joint that
    /// the body carries.
    pub capsules: Vec<LinkCapsule>,
    /// Other convex shapes, in addition to the capsules.
    pub shapes: Vec<LinkShape>,
    /// Pairs of links that may touch, in addition to adjacent links.
    pub ignored: Vec<[String; 2]>,
    /// Whether to omit pairs whose shapes overlap: pairs that touch in the neutral posture (every joint at zero, or
    /// as close as its limits allow) and in most of 256 random postures within the limits. Pairs that are closer than
    /// `clearance_m` in all of these postures are omitted if they touch in none of them; otherwise they must not
    /// touch. Pairs that are closer than twice `clearance_m` in all postures must keep half of their largest
    /// distance.
    pub leave_out_touching: bool,
    /// Share of the random postures in which a pair must touch, in addition to the neutral posture, to be omitted
    /// with `leave_out_touching`. Default 0.5; not part of study files.
    #[serde(skip)]
    pub min_overlap_share: f64,
}

impl Default for SelfCollision {
    /// Fitted capsules of 0.06 m radius (the tubes of an arm of 5 to 15 kg), no additional clearance.
    fn default() -> Self {
        Self {
            radius_m: 0.06,
            clearance_m: 0.0,
            capsules: Vec::new(),
            shapes: Vec::new(),
            ignored: Vec::new(),
            leave_out_touching: false,
            min_overlap_share: 0.5,
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
    /// The other end, m; equal ends form a sphere.
    pub to_m: [f64; 3],
    /// Radius, m.
    pub radius_m: f64,
}

/// A convex shape in a link's frame: all points within `radius_m` of the hull of its corners. Two corners form a
/// capsule, eight a box.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LinkShape {
    /// Name of the link.
    pub link: String,
    /// Corners, m; at least one.
    pub corners_m: Vec<[f64; 3]>,
    /// Radius around the hull of the corners, m.
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
    ///
    /// # Errors
    /// An unknown link, a value that is not finite, a negative radius or clearance, or a share out of range.
    pub fn validate(&self, model: &Model) -> Result<(), LimitError> {
        not_negative("clearance of the self-collision limit", self.clearance_m)?;
        not_negative("overlap share of the self-collision limit", self.min_overlap_share)?;
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

    pub(crate) fn fitted(&self) -> bool {
        self.capsules.is_empty() && self.shapes.is_empty()
    }

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

/// Capsules from each body's origin to the origins of the joints it carries. A body at a tip has a capsule to the
/// farthest fixed link, or a sphere. The capsules of the base start at the base frame.
pub(crate) fn fitted_capsules(model: &Model, radius_m: f64) -> Vec<LinkShape> {
    (0..=model.body_count()).flat_map(|index| body_capsules(model, index.checked_sub(1), radius_m)).collect()
}

/// Capsules of `radius_m` from the origin of a body to the origins of the joints that it carries; at a tip to the
/// farthest fixed link. `None` is the base. They are in the frame of the body's first link, m.
pub fn body_capsules(model: &Model, body: Option<usize>, radius_m: f64) -> Vec<LinkShape> {
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
