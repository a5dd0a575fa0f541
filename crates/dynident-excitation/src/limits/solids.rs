//! Links as solids: distance between the surfaces of two solids, and lowest point of one.

use super::convex::{Placed, hull_distance};
use super::error::LimitError;
use super::link_points::link_place;
use super::self_collision_shapes::LinkShape;
use dynident_model::{Model, Transform, Vec3};

/// A convex shape on a body: all points within `radius_m` of the hull of its corners (body frame).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BodyShape {
    pub corners: Vec<Vec3>,
    pub radius_m: f64,
    centre: Vec3,
    reach_m: f64,
}

/// All shapes of one link, on its body (`None`: the base).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkSolid {
    pub body: Option<usize>,
    pub link: String,
    pub shapes: Vec<BodyShape>,
    /// Mean of all corners.
    pub centre: Vec3,
    /// Radius of a sphere around the centre that contains all shapes, m.
    pub reach_m: f64,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SolidDistance {
    /// Distance between the surfaces, m; if negative, the shapes overlap, and the magnitude is a measure of the
    /// depth. A distance above the requested one is a lower bound.
    pub surface_m: f64,
    /// Points of the two links that determine the change of the distance.
    pub points: [Vec3; 2],
    /// Radius of each link's surface around its point, m.
    pub radii_m: [f64; 2],
    /// Unit vector from the second point to the first.
    pub direction: Vec3,
    /// Derivative of `surface_m` with respect to the distance of the points: 1, except for overlapping hulls.
    pub slope: f64,
}

/// Weight of the distance of the centres for overlapping hulls. It defines the direction out of the overlap, and is
/// too small to compensate a contact.
const CENTRE_DISTANCE_WEIGHT: f64 = 0.2;

impl BodyShape {
    fn new(corners: Vec<Vec3>, radius_m: f64) -> Self {
        let (centre, farthest) = ball(&corners);
        Self { corners, radius_m, centre, reach_m: farthest + radius_m }
    }
}

fn ball(points: &[Vec3]) -> (Vec3, f64) {
    let sum = points.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    let centre = sum.scale(1.0 / points.len().max(1) as f64);
    (centre, points.iter().fold(0.0, |far: f64, point| far.max((*point - centre).norm())))
}

impl LinkSolid {
    /// Collects shapes by link name, in the order of first appearance.
    ///
    /// # Errors
    /// An unknown link.
    pub(crate) fn gather(model: &Model, shapes: &[LinkShape], what: &str) -> Result<Vec<Self>, LimitError> {
        let mut solids: Vec<Self> = Vec::new();
        for shape in shapes {
            let (body, placement) = link_place(model, &shape.link, what)?;
            let corners = shape.corners_m.iter().map(|corner| placement.point(Vec3(*corner))).collect();
            let shape_on_body = BodyShape::new(corners, shape.radius_m);
            if let Some(solid) = solids.iter_mut().find(|solid| solid.link == shape.link) {
                solid.shapes.push(shape_on_body);
            } else {
                let link = shape.link.clone();
                let shapes = vec![shape_on_body];
                solids.push(Self { body, link, shapes, centre: Vec3::ZERO, reach_m: 0.0 });
            }
        }
        for solid in &mut solids {
            let corners: Vec<Vec3> = solid.shapes.iter().flat_map(|shape| shape.corners.iter().copied()).collect();
            solid.centre = ball(&corners).0;
            let reach = |shape: &BodyShape| (shape.centre - solid.centre).norm() + shape.reach_m;
            solid.reach_m = solid.shapes.iter().map(reach).fold(0.0, f64::max);
        }
        Ok(solids)
    }

    /// Height of the lowest point above the plane z = 0 of the base frame, m, and its position.
    pub(crate) fn lowest(&self, at: &Transform) -> (f64, Vec3) {
        let down = at.rotation.transpose_mul_vec(Vec3([0.0, 0.0, 1.0]));
        let mut lowest = (f64::INFINITY, Vec3::ZERO);
        for shape in &self.shapes {
            for corner in &shape.corners {
                let height = corner.dot(down) - shape.radius_m;
                if height < lowest.0 {
                    lowest = (height, *corner);
                }
            }
        }
        (lowest.0 + at.translation[2], at.point(lowest.1))
    }
}

/// Distance between the surfaces of two links. A distance above `beyond` need not be exact. `guesses` contains the
/// initial direction of [`hull_distance`] for each pair of shapes.
pub(crate) fn solid_distance(
    first: &LinkSolid,
    first_at: &Transform,
    second: &LinkSolid,
    second_at: &Transform,
    beyond: f64,
    guesses: &mut Vec<Vec3>,
) -> SolidDistance {
    let mut nearest =
        by_balls(first_at.point(first.centre), first.reach_m, second_at.point(second.centre), second.reach_m);
    if nearest.surface_m > beyond {
        return nearest;
    }
    nearest.surface_m = f64::INFINITY;
    guesses.resize(first.shapes.len() * second.shapes.len(), Vec3::ZERO);
    let mut guesses = guesses.iter_mut();
    let mut bound: Option<SolidDistance> = None;
    for a in &first.shapes {
        for b in &second.shapes {
            let Some(guess) = guesses.next() else { continue };
            let centres = [first_at.point(a.centre), second_at.point(b.centre)];
            let balls = by_balls(centres[0], a.reach_m, centres[1], b.reach_m);
            let beyond = beyond.min(nearest.surface_m);
            let found = if balls.surface_m > beyond {
                balls
            } else {
                let radii_m = [a.radius_m, b.radius_m];
                let radii = a.radius_m + b.radius_m;
                let hulls =
                    [Placed { corners: &a.corners, at: first_at }, Placed { corners: &b.corners, at: second_at }];
                let hull = hull_distance(hulls[0], hulls[1], beyond + radii, guess);
                if hull.distance_m > 0.0 || (a.corners.len() <= 2 && b.corners.len() <= 2) {
                    SolidDistance {
                        surface_m: hull.distance_m - radii,
                        points: hull.points,
                        radii_m,
                        direction: hull.direction,
                        slope: 1.0,
                    }
                } else {
                    let inside = CENTRE_DISTANCE_WEIGHT * balls.surface_m.min(0.0);
                    SolidDistance { surface_m: inside - radii, radii_m, slope: CENTRE_DISTANCE_WEIGHT, ..balls }
                }
            };
            if found.surface_m > beyond {
                // Only a lower bound is known, or the shapes are farther apart than the nearest known pair.
                if bound.is_none_or(|bound| found.surface_m < bound.surface_m) {
                    bound = Some(found);
                }
            } else if found.surface_m < nearest.surface_m {
                nearest = found;
            }
        }
    }
    if nearest.surface_m.is_finite() { nearest } else { bound.unwrap_or(nearest) }
}

fn by_balls(first: Vec3, first_reach: f64, second: Vec3, second_reach: f64) -> SolidDistance {
    let apart = first - second;
    let length = apart.norm();
    let direction = if length > 0.0 { apart.scale(1.0 / length) } else { Vec3([0.0, 0.0, 1.0]) };
    SolidDistance {
        surface_m: length - first_reach - second_reach,
        points: [first, second],
        radii_m: [first_reach, second_reach],
        direction,
        slope: 1.0,
    }
}
