//! Pairs of links with a minimum distance, and their distances.

use super::error::LimitError;
use super::self_collision_shapes::SelfCollision;
use super::solids::{LinkSolid, solid_distance};
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::sample::Random;
use dynident_model::{Model, Transform};

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SolidPairs {
    pub solids: Vec<LinkSolid>,
    pub pairs: Vec<SolidPair>,
    /// Pairs that are not checked because their shapes overlap, although they are neither adjacent nor ignored.
    /// Define other shapes for links that can collide.
    pub left_out: Vec<[String; 2]>,
    /// Pairs that are always closer than the clearance but touch in no tested posture. They are close by design and
    /// not checked.
    pub close: Vec<[String; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SolidPair {
    /// Indices of the solids.
    pub of: [usize; 2],
    /// Minimum distance between the surfaces, m.
    pub clearance_m: f64,
    /// Length by which a missing distance is divided, m.
    pub size_m: f64,
}

const POSTURES: usize = 256;

/// Minimum of that length, as a share of the arm's length.
const MIN_RELATIVE_SIZE: f64 = 0.05;

/// Length of the longest chain of joints from the base, m; the characteristic length of a machine.
pub fn arm_length_m(model: &Model) -> f64 {
    let mut lengths: Vec<f64> = Vec::with_capacity(model.body_count());
    for joint in model.tree_joints() {
        let stroke = if joint.is_rotary() {
            0.0
        } else {
            joint.limits.lower.zip(joint.limits.upper).map_or(0.0, |(lower, upper)| lower.abs().max(upper.abs()))
        };
        lengths.push(joint.parent.map_or(0.0, |parent| lengths[parent]) + joint.placement.translation.norm() + stroke);
    }
    let tip = |(body, length): (usize, f64)| {
        let links = model.bodies()[body].links.iter().map(|link| link.placement.translation.norm());
        length + links.fold(0.0, f64::max)
    };
    lengths.into_iter().enumerate().map(tip).fold(0.0, f64::max)
}

/// Posture with every joint at zero, or as close to zero as the limits of the robot description allow.
pub fn neutral_posture(model: &Model) -> Vec<f64> {
    let nearest = |joint: &dynident_model::Joint| {
        let (lower, upper) = (joint.limits.lower.unwrap_or(0.0), joint.limits.upper.unwrap_or(0.0));
        if lower <= upper { 0.0_f64.max(lower).min(upper.max(lower)) } else { 0.0 }
    };
    model.joints().iter().map(nearest).collect()
}

/// Random postures (fixed seed) within the limits of the robot description; without limits within a full turn, or
/// half a metre to either side.
pub(crate) fn random_postures(model: &Model, count: usize) -> Vec<Vec<f64>> {
    let mut random = Random::new(1);
    let mut posture = || {
        let position = |joint: &dynident_model::Joint| {
            let reach = if joint.is_rotary() { core::f64::consts::PI } else { 0.5 };
            let (lower, upper) = joint.limits.lower.zip(joint.limits.upper).unwrap_or((-reach, reach));
            random.uniform(lower, upper)
        };
        model.joints().iter().map(position).collect()
    };
    (0..count).map(|_| posture()).collect()
}

impl SelfCollision {
    /// Assigns the shapes to their bodies and determines the pairs that must keep a distance: all pairs except those
    /// on one body, adjacent ones (parent and child) and ignored ones. For capsules that were **fitted** to links,
    /// pairs that overlap in each of 256 random postures are also omitted. With `leave_out_touching`, the pairs that
    /// its documentation describes are omitted, too.
    ///
    /// # Errors
    /// Errors of [`validate`](SelfCollision::validate).
    pub(crate) fn resolve(&self, model: &Model) -> Result<SolidPairs, LimitError> {
        self.validate(model)?;
        let solids = LinkSolid::gather(model, &self.all_shapes(model), "a shape of the self-collision limit")?;
        let is_neighbour = |a: Option<usize>, b: Option<usize>| {
            let parent = |body: Option<usize>| body.map(|body| model.tree_joints()[body].parent);
            a == b || parent(a) == Some(b) || parent(b) == Some(a)
        };
        let is_ignored = |a: &str, b: &str| {
            self.ignored.iter().any(|[first, second]| (first == a && second == b) || (first == b && second == a))
        };
        let least_size = MIN_RELATIVE_SIZE * arm_length_m(model);
        let mut pairs = Vec::new();
        for (second, b) in solids.iter().enumerate() {
            for (first, a) in solids[..second].iter().enumerate() {
                if !is_neighbour(a.body, b.body) && !is_ignored(&a.link, &b.link) {
                    let thinnest = |solid: &LinkSolid| {
                        solid.shapes.iter().map(|shape| shape.radius_m).fold(f64::INFINITY, f64::min)
                    };
                    let size_m = (thinnest(a) + thinnest(b) + self.clearance_m).max(least_size).max(1e-9);
                    pairs.push(SolidPair { of: [first, second], clearance_m: self.clearance_m, size_m });
                }
            }
        }
        let mut resolved = SolidPairs { solids, pairs, left_out: Vec::new(), close: Vec::new() };
        if self.fitted() || self.leave_out_touching {
            resolved.leave_out(model, self.leave_out_touching, self.min_overlap_share);
        }
        Ok(resolved)
    }
}

impl SolidPairs {
    /// Omits pairs whose shapes overlap, and reduces the clearance of pairs that cannot keep it.
    fn leave_out(&mut self, model: &Model, touching: bool, min_overlap_share: f64) {
        let mut workspace = Workspace::new(model);
        // For each pair: contact in the neutral posture, number of other postures with contact, and largest distance.
        let mut seen = vec![(false, 0_usize, f64::NEG_INFINITY); self.pairs.len()];
        let postures = core::iter::once(neutral_posture(model)).chain(random_postures(model, POSTURES));
        for (number, q) in postures.enumerate() {
            let placements = body_placements(model, &mut workspace, &q);
            for (pair, (neutral, touched, farthest)) in self.pairs.iter().zip(&mut seen) {
                let [a, b] = pair.of.map(|place| {
                    let solid = &self.solids[place];
                    (solid, solid.body.map_or(Transform::IDENTITY, |body| placements[body]))
                });
                let beyond = 2.0 * pair.clearance_m;
                let apart = solid_distance(a.0, &a.1, b.0, &b.1, beyond, &mut Vec::new()).surface_m;
                let short = if touching { apart <= 0.0 } else { apart < pair.clearance_m };
                if number == 0 {
                    *neutral = short;
                } else {
                    *touched += usize::from(short);
                }
                *farthest = farthest.max(apart);
            }
        }
        let mut kept = Vec::with_capacity(self.pairs.len());
        for (pair, (neutral, touched, farthest)) in self.pairs.iter().zip(seen) {
            let always = touched == POSTURES;
            if always || (touching && neutral && touched as f64 > min_overlap_share * POSTURES as f64) {
                self.left_out.push(pair.of.map(|place| self.solids[place].link.clone()));
            } else if touching && farthest < pair.clearance_m {
                // Pairs that are always within the clearance are close by design. If they touch in some posture, they
                // must keep a positive distance.
                if neutral || touched > 0 {
                    kept.push(SolidPair { clearance_m: 0.0, ..*pair });
                } else {
                    self.close.push(pair.of.map(|place| self.solids[place].link.clone()));
                }
            } else {
                // Links that are never far apart must keep at most half of their largest distance, so that they can
                // move.
                let most = if touching { 0.5 * farthest } else { pair.clearance_m };
                kept.push(SolidPair { clearance_m: pair.clearance_m.min(most), ..*pair });
            }
        }
        self.pairs = kept;
    }
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
            fitted.pairs.iter().map(|pair| pair.of.map(|index| fitted.solids[index].link.as_str())).collect();
        assert!(names.contains(&["shoulder_link", "forearm_link"]), "{names:?}");
        assert!(names.contains(&["upper_arm_link", "wrist_3_link"]), "{names:?}");
        // The wrist's axes are 0.115 m apart in every posture, less than two radii.
        assert!(
            fitted.left_out.iter().any(|[a, b]| a == "forearm_link" && b == "wrist_2_link"),
            "{:?}",
            fitted.left_out
        );
        for pair in &fitted.pairs {
            let parent = |index: usize| fitted.solids[index].body.map(|body| model.tree_joints()[body].parent);
            assert_ne!(parent(pair.of[1]), Some(fitted.solids[pair.of[0]].body), "neighbours are no pair");
        }
    }
}
