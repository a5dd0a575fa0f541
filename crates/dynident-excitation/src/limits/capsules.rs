//! Self-collision as a description: capsules on the links, given or fitted, and the pairs that must stay apart.

use super::error::LimitError;
use super::link_points::link_place;
use super::segments::segment_distance;
use super::validate::{finite, not_negative, positive};
use dynident_model::sample::Random;
use dynident_model::{Model, Transform, Vec3};
use serde::{Deserialize, Serialize};

/// Distances between the arm's own links, which are taken as capsules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SelfCollision {
    /// Radius of fitted capsules, m.
    pub radius_m: f64,
    /// Least distance between capsule surfaces, m.
    pub clearance_m: f64,
    /// The capsules; none: fitted, from each body's origin to the origins of the joints that it carries.
    pub capsules: Vec<LinkCapsule>,
    /// Pairs of links that may touch, besides neighbours.
    pub ignored: Vec<[String; 2]>,
}

impl Default for SelfCollision {
    /// Fitted capsules of 0.06 m radius (the tube of a 5 to 15 kg arm), no extra clearance.
    fn default() -> Self {
        Self { radius_m: 0.06, clearance_m: 0.0, capsules: Vec::new(), ignored: Vec::new() }
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

/// A capsule on a body (`None`: the base), ends in the body's frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyCapsule {
    /// Index of the body.
    pub body: Option<usize>,
    /// Name of the link.
    pub link: String,
    /// Ends of the segment, m.
    pub ends: [Vec3; 2],
    /// Radius, m.
    pub radius_m: f64,
}

/// The capsules of a robot and which of them must stay apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CapsulePairs {
    /// All capsules.
    pub capsules: Vec<BodyCapsule>,
    /// Pairs that are kept apart, by capsule number.
    pub pairs: Vec<[usize; 2]>,
    /// Pairs of links whose **fitted** capsules overlap in every posture tried, so that keeping them apart would forbid
    /// all motion. They are not checked: give capsules of their own to links that can really touch.
    pub left_out: Vec<[String; 2]>,
}

/// Postures tried to find fitted pairs that always overlap.
const POSTURES: usize = 256;

impl SelfCollision {
    /// Checks numbers and names.
    ///
    /// # Errors
    /// If a link is unknown, a number is not finite, a radius or the clearance negative, or a pair has no size at all
    /// to keep apart.
    pub fn validate(&self, model: &Model) -> Result<(), LimitError> {
        not_negative("clearance of the self-collision limit", self.clearance_m)?;
        if self.capsules.is_empty() {
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
        for name in self.ignored.iter().flatten() {
            link_place(model, name, "the list of ignored pairs")?;
        }
        Ok(())
    }

    /// The capsules on their bodies and the pairs to keep apart: all but those on one body, on neighbours (parent and
    /// child) and those ignored. Of **fitted** capsules also those are left out that overlap in each of 256 seeded
    /// postures within the position limits of the description.
    ///
    /// # Errors
    /// As [`validate`](SelfCollision::validate).
    pub(crate) fn resolve(&self, model: &Model) -> Result<CapsulePairs, LimitError> {
        self.validate(model)?;
        let given = |capsule: &LinkCapsule| {
            let (body, placement) = link_place(model, &capsule.link, "a capsule")?;
            let ends = [capsule.from_m, capsule.to_m].map(|end| placement.point(Vec3(end)));
            Ok(BodyCapsule { body, link: capsule.link.clone(), ends, radius_m: capsule.radius_m })
        };
        let fitted = self.capsules.is_empty();
        let capsules = if fitted {
            fitted_capsules(model, self.radius_m)
        } else {
            self.capsules.iter().map(given).collect::<Result<Vec<_>, LimitError>>()?
        };
        let is_neighbour = |a: Option<usize>, b: Option<usize>| {
            let parent = |body: Option<usize>| body.map(|body| model.joints()[body].parent);
            a == b || parent(a) == Some(b) || parent(b) == Some(a)
        };
        let is_ignored = |a: &str, b: &str| {
            self.ignored.iter().any(|[first, second]| (first == a && second == b) || (first == b && second == a))
        };
        let mut pairs = Vec::new();
        for (second, b) in capsules.iter().enumerate() {
            for (first, a) in capsules[..second].iter().enumerate() {
                if !is_neighbour(a.body, b.body) && !is_ignored(&a.link, &b.link) {
                    pairs.push([first, second]);
                }
            }
        }
        let mut left_out = Vec::new();
        if fitted {
            let overlap = always_overlapping(model, &capsules, &pairs, self.clearance_m);
            for (pair, overlap) in pairs.iter().zip(&overlap) {
                let names = pair.map(|index| capsules[index].link.clone());
                if *overlap && !left_out.contains(&names) {
                    left_out.push(names);
                }
            }
            let mut overlap = overlap.into_iter();
            pairs.retain(|_| !overlap.next().unwrap_or(false));
        }
        Ok(CapsulePairs { capsules, pairs, left_out })
    }
}

/// From each body's origin to the origins of the joints it carries; at a tip to the farthest fixed link, or a sphere.
fn fitted_capsules(model: &Model, radius_m: f64) -> Vec<BodyCapsule> {
    let bodies = core::iter::once((None, model.base()))
        .chain(model.bodies().iter().enumerate().map(|(index, body)| (Some(index), body)));
    let mut capsules = Vec::new();
    for (index, body) in bodies {
        let Some(link) = body.links.first() else { continue };
        let mut far: Vec<Vec3> = model
            .joints()
            .iter()
            .filter(|joint| joint.parent == index)
            .map(|joint| joint.placement.translation)
            .collect();
        if far.is_empty() {
            let places = body.links.iter().map(|link| link.placement.translation);
            far.extend(places.max_by(|a, b| a.norm().total_cmp(&b.norm())));
        }
        for end in far {
            capsules.push(BodyCapsule { body: index, link: link.name.clone(), ends: [Vec3::ZERO, end], radius_m });
        }
    }
    capsules
}

fn always_overlapping(model: &Model, capsules: &[BodyCapsule], pairs: &[[usize; 2]], clearance_m: f64) -> Vec<bool> {
    let mut random = Random::new(1);
    let mut workspace = dynident_dynamics::Workspace::new(model);
    let mut always = vec![true; pairs.len()];
    let mut q = vec![0.0; model.dof()];
    for _ in 0..POSTURES {
        for (q, joint) in q.iter_mut().zip(model.joints()) {
            // A joint without limits turns all the way; one that slides without limits moves a metre.
            let reach = if joint.turns() { core::f64::consts::PI } else { 0.5 };
            let (lower, upper) = joint.limits.lower.zip(joint.limits.upper).unwrap_or((-reach, reach));
            *q = random.uniform(lower, upper);
        }
        let placements = dynident_dynamics::body_placements(model, &mut workspace, &q);
        for (always, [first, second]) in always.iter_mut().zip(pairs) {
            let (a, b) = (&capsules[*first], &capsules[*second]);
            let place = |body: Option<usize>| body.map_or(Transform::IDENTITY, |body| placements[body]);
            let ends = |capsule: &BodyCapsule| capsule.ends.map(|end| place(capsule.body).point(end));
            let required = a.radius_m + b.radius_m + clearance_m;
            *always &= segment_distance(ends(a), ends(b)).distance_m < required;
        }
    }
    always
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fitted_capsules_keep_the_forearm_from_the_shoulder_and_leave_out_the_wrist() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/ur10.urdf");
        let model = dynident_model::load_robot(path).unwrap().model;
        let fitted = SelfCollision::default().resolve(&model).unwrap();
        let names: Vec<[&str; 2]> =
            fitted.pairs.iter().map(|pair| pair.map(|index| fitted.capsules[index].link.as_str())).collect();
        assert!(names.contains(&["shoulder_link", "forearm_link"]), "{names:?}");
        assert!(names.contains(&["upper_arm_link", "wrist_3_link"]), "{names:?}");
        // The wrist's axes are 0.115 m apart, less than two radii, in every posture.
        assert!(
            fitted.left_out.iter().any(|[a, b]| a == "forearm_link" && b == "wrist_2_link"),
            "{:?}",
            fitted.left_out
        );
        for [first, second] in &fitted.pairs {
            let parent = |index: usize| fitted.capsules[index].body.map(|body| model.joints()[body].parent);
            assert_ne!(parent(*second), Some(fitted.capsules[*first].body), "neighbours are no pair");
        }
    }
}
