//! Distances of links along a motion, for pictures.

use super::error::LimitError;
use super::pairs::SolidPairs;
use super::self_collision_shapes::SelfCollision;
use super::solids::solid_distance;
use crate::motion::Motion;
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{Model, Transform, Vec3};

/// Distance of two links along a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct PairDistance {
    /// Names of the links.
    pub links: [String; 2],
    /// Minimum distance between the surfaces, m.
    pub clearance_m: f64,
    /// Distance between the surfaces at each sample, m; negative if they overlap.
    pub distance_m: Vec<f64>,
    /// Nearest points of the two surfaces at each sample, in the base frame, m. For overlapping shapes they are
    /// inside the shapes.
    pub points_m: Vec<[[f64; 3]; 2]>,
}

impl PairDistance {
    /// Smallest distance along the motion, m.
    pub fn smallest_m(&self) -> f64 {
        self.distance_m.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

impl SelfCollision {
    /// Computes the distance of every pair of links with a minimum distance, at every `step`-th sample of a motion.
    ///
    /// # Errors
    /// Errors of [`validate`](SelfCollision::validate).
    pub fn distances(&self, model: &Model, motion: &Motion, step: usize) -> Result<Vec<PairDistance>, LimitError> {
        let SolidPairs { solids, pairs, .. } = self.resolve(model)?;
        let mut found: Vec<PairDistance> = pairs
            .iter()
            .map(|pair| PairDistance {
                links: pair.of.map(|index| solids[index].link.clone()),
                clearance_m: pair.clearance_m,
                distance_m: Vec::new(),
                points_m: Vec::new(),
            })
            .collect();
        let mut guesses: Vec<Vec<Vec3>> = vec![Vec::new(); pairs.len()];
        let mut workspace = Workspace::new(model);
        for sample in (0..motion.samples).step_by(step.max(1)) {
            let q: Vec<f64> = (0..motion.joints).map(|joint| motion.q[joint * motion.samples + sample]).collect();
            let placements = body_placements(model, &mut workspace, &q);
            for ((pair, own), guesses) in pairs.iter().zip(&mut found).zip(&mut guesses) {
                let [first, second] = pair.of.map(|index| &solids[index]);
                let at = |body: Option<usize>| body.map_or(Transform::IDENTITY, |body| placements[body]);
                let apart = solid_distance(first, &at(first.body), second, &at(second.body), f64::INFINITY, guesses);
                let inwards = [-apart.radii_m[0], apart.radii_m[1]];
                own.distance_m.push(apart.surface_m);
                own.points_m.push([0, 1].map(|end| (apart.points[end] + apart.direction.scale(inwards[end])).0));
            }
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::LinkCapsule;
    use dynident_model::read_robot;

    /// Two arms with parallel vertical axes 2 m apart: each carries a ball of 0.1 m at 0.5 m from its axis.
    const URDF: &str = r#"<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
        <joint name="j" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
        <joint name="k" type="continuous"><parent link="base"/><child link="b"/><origin xyz="2 0 0"/><axis xyz="0 0 1"/></joint></robot>"#;

    #[test]
    fn distance_and_nearest_points_are_those_of_two_balls() {
        let model = read_robot(URDF.to_owned(), std::path::Path::new("r.urdf")).unwrap().model;
        let ball = |link: &str| LinkCapsule {
            link: link.into(),
            from_m: [0.5, 0.0, 0.0],
            to_m: [0.5, 0.0, 0.0],
            radius_m: 0.1,
        };
        let limit =
            SelfCollision { clearance_m: 0.3, capsules: vec![ball("a"), ball("b")], ..SelfCollision::default() };
        let mut motion = Motion::default();
        motion.reset(2, 40);
        for (joint, rate) in [0.1, 0.23].into_iter().enumerate() {
            let range = motion.of(joint);
            for (sample, q) in motion.q[range].iter_mut().enumerate() {
                *q = rate * sample as f64;
            }
        }
        let found = limit.distances(&model, &motion, 3).unwrap();
        let [pair] = &found[..] else { panic!("{found:?}") };
        assert!(pair.links == ["a", "b"] && pair.clearance_m == 0.3 && pair.distance_m.len() == 14);
        for (k, (distance, [p, q])) in pair.distance_m.iter().zip(&pair.points_m).enumerate() {
            let sample = 3.0 * k as f64;
            let (one, two) = ((0.1 * sample).sin_cos(), (0.23 * sample).sin_cos());
            let centres = [[0.5 * one.1, 0.5 * one.0], [2.0 + 0.5 * two.1, 0.5 * two.0]];
            let between = [centres[1][0] - centres[0][0], centres[1][1] - centres[0][1]];
            let length = between[0].hypot(between[1]);
            assert!((distance - (length - 0.2)).abs() < 1e-12);
            for axis in 0..2 {
                assert!((p[axis] - (centres[0][axis] + 0.1 * between[axis] / length)).abs() < 1e-12);
                assert!((q[axis] - (centres[1][axis] - 0.1 * between[axis] / length)).abs() < 1e-12);
            }
        }
        assert!((pair.smallest_m() - pair.distance_m.iter().copied().fold(9.0, f64::min)).abs() == 0.0);
    }
}
