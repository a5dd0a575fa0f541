//! Links as solids: the distance between the surfaces of two, and how low one reaches.

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
    /// Mean of the corners.
    centre: Vec3,
    /// Radius of a sphere about the centre that holds the shape, m.
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
    /// Radius of a ball about it that holds all shapes, m.
    pub reach_m: f64,
}

/// How far two links are apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolidDistance {
    /// From surface to surface, m; negative where they overlap, then a measure of how deeply. Beyond the distance asked
    /// for a lower bound.
    pub surface_m: f64,
    /// Points of the two that the distance changes with.
    pub points: [Vec3; 2],
    /// Unit vector from the second's point to the first's.
    pub direction: Vec3,
    /// Change of `surface_m` by the distance of the points: 1, but for hulls that overlap.
    pub slope: f64,
}

/// Weight of the distance of centres where hulls overlap: it says where out is, and never balances a contact.
const DEEP: f64 = 0.2;

impl BodyShape {
    fn new(corners: Vec<Vec3>, radius_m: f64) -> Self {
        let (centre, farthest) = ball(&corners);
        Self { corners, radius_m, centre, reach_m: farthest + radius_m }
    }
}

/// Mean of the points, and how far one of them is from it.
fn ball(points: &[Vec3]) -> (Vec3, f64) {
    let sum = points.iter().fold(Vec3::ZERO, |sum, point| sum + *point);
    let centre = sum.scale(1.0 / points.len().max(1) as f64);
    (centre, points.iter().fold(0.0, |far: f64, point| far.max((*point - centre).norm())))
}

impl LinkSolid {
    /// Shapes by link name, gathered link by link in the order of first appearance.
    ///
    /// # Errors
    /// A link that the robot does not have.
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

    /// The lowest point above the plane z = 0 of the base frame, m, and where it is.
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

/// The distance of two links from surface to surface. What is above `beyond` need not be exact. `guesses`: what
/// [`hull_distance`] keeps of each two shapes.
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
                let radii = a.radius_m + b.radius_m;
                let hulls =
                    [Placed { corners: &a.corners, at: first_at }, Placed { corners: &b.corners, at: second_at }];
                let hull = hull_distance(hulls[0], hulls[1], beyond + radii, guess);
                if hull.distance_m > 0.0 || (a.corners.len() <= 2 && b.corners.len() <= 2) {
                    SolidDistance {
                        surface_m: hull.distance_m - radii,
                        points: hull.points,
                        direction: hull.direction,
                        slope: 1.0,
                    }
                } else {
                    let inside = DEEP * balls.surface_m.min(0.0);
                    SolidDistance { surface_m: inside - radii, slope: DEEP, ..balls }
                }
            };
            if found.surface_m > beyond {
                // A bound, or farther than what is known.
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

/// The distance of two balls.
fn by_balls(first: Vec3, first_reach: f64, second: Vec3, second_reach: f64) -> SolidDistance {
    let apart = first - second;
    let length = apart.norm();
    let direction = if length > 0.0 { apart.scale(1.0 / length) } else { Vec3([0.0, 0.0, 1.0]) };
    SolidDistance { surface_m: length - first_reach - second_reach, points: [first, second], direction, slope: 1.0 }
}
