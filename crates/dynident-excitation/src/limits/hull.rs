//! Reduction of a shape to a few corners.

use super::convex::{Placed, hull_distance};
use super::pieces::spiral;
use super::self_collision_shapes::LinkShape;
use dynident_model::collision::Solid;
use dynident_model::{Transform, Vec3};

/// A shape with more corners than this is replaced by a coarser shape that contains it.
const MAX_EXACT_CORNERS: usize = 32;

/// Number of directions in which the outermost corners are selected.
const DIRECTIONS: usize = 40;

const MAX_CLOSE_CORNERS: usize = 80;

impl LinkShape {
    /// The solid on a link. A solid with many corners, such as a mesh, is replaced by the hull of its outermost
    /// corners in 40 directions, with a radius that contains all other corners. The replacement is never smaller than
    /// the solid.
    pub fn holding(link: &str, solid: &Solid) -> Self {
        let Solid { corners_m, radius_m, .. } = solid;
        let (corners, gap_m) = if corners_m.len() <= MAX_EXACT_CORNERS {
            (corners_m.clone(), 0.0)
        } else {
            let corners = outermost(corners_m);
            let gap_m = farthest_from(&corners, corners_m);
            (corners, gap_m)
        };
        Self {
            link: link.to_owned(),
            corners_m: corners.iter().map(|corner| corner.0).collect(),
            radius_m: radius_m + gap_m,
        }
    }

    /// A closer shape around the hull of corners on a link. The farthest corner is added repeatedly, until all
    /// corners are within `gap_m` of the hull or there are 80; the radius contains the remaining corners.
    pub(super) fn closely(link: &str, corners_m: &[Vec3], radius_m: f64, gap_m: f64) -> Self {
        let mut hull = if corners_m.len() <= MAX_EXACT_CORNERS { corners_m.to_vec() } else { outermost(corners_m) };
        let mut outside = if hull.len() == corners_m.len() { Vec::new() } else { corners_m.to_vec() };
        // When the hull grows, the distance of a corner can only decrease.
        let mut near_m = 0.0_f64;
        let left_m = loop {
            let mut farthest = (0.0, None);
            outside.retain(|corner| {
                let apart = farthest_from(&hull, core::slice::from_ref(corner));
                if apart > farthest.0 {
                    farthest = (apart, Some(*corner));
                }
                if apart <= gap_m {
                    near_m = near_m.max(apart);
                }
                apart > gap_m
            });
            match farthest {
                (apart, Some(corner)) if apart > gap_m && hull.len() < MAX_CLOSE_CORNERS => hull.push(corner),
                (apart, _) => break apart.max(near_m),
            }
        };
        Self {
            link: link.to_owned(),
            corners_m: hull.iter().map(|corner| corner.0).collect(),
            radius_m: radius_m + left_m,
        }
    }
}

fn outermost(corners: &[Vec3]) -> Vec<Vec3> {
    let mut found: Vec<usize> = Vec::new();
    for direction in spiral(DIRECTIONS) {
        let mut best = (f64::NEG_INFINITY, 0);
        for (index, corner) in corners.iter().enumerate() {
            let along = corner.dot(direction);
            if along > best.0 {
                best = (along, index);
            }
        }
        if !found.contains(&best.1) {
            found.push(best.1);
        }
    }
    found.into_iter().map(|index| corners[index]).collect()
}

fn farthest_from(hull: &[Vec3], points: &[Vec3]) -> f64 {
    let at = Transform::IDENTITY;
    let mut farthest = 0.0_f64;
    for point in points {
        let one = core::slice::from_ref(point);
        let hulls = [Placed { corners: hull, at: &at }, Placed { corners: one, at: &at }];
        farthest = farthest.max(hull_distance(hulls[0], hulls[1], f64::INFINITY, &mut Vec3::ZERO.clone()).distance_m);
    }
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use dynident_model::sample::Random;

    #[test]
    fn the_coarser_shape_contains_the_finer_one() {
        let mut random = Random::new(5);
        let corners_m: Vec<Vec3> = (0..2000)
            .map(|_| {
                let [x, y, z] = random.direction().0;
                Vec3([0.05 * x, 0.08 * y, 0.3 * z + 0.1])
            })
            .collect();
        let shape =
            LinkShape::holding("rod", &Solid { corners_m: corners_m.clone(), radius_m: 0.0, triangles: Vec::new() });
        assert!(shape.corners_m.len() <= DIRECTIONS && shape.radius_m < 0.02, "{}", shape.radius_m);
        let hull: Vec<Vec3> = shape.corners_m.iter().map(|corner| Vec3(*corner)).collect();
        assert!(farthest_from(&hull, &corners_m) <= shape.radius_m);
        let closer = LinkShape::closely("rod", &corners_m, 0.0, 0.003);
        let hull: Vec<Vec3> = closer.corners_m.iter().map(|corner| Vec3(*corner)).collect();
        assert!(hull.len() <= MAX_CLOSE_CORNERS && closer.radius_m < 0.5 * shape.radius_m, "{}", closer.radius_m);
        assert!(farthest_from(&hull, &corners_m) <= closer.radius_m);
    }
}
