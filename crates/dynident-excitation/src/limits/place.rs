//! Limits of box, floor and column: places of points of the arm, in the base frame.

use super::description::{BoxLimit, ColumnLimit, FloorLimit};
use super::error::LimitError;
use super::kind::{Constraint, LimitKind};
use super::link_points::{BodyPoint, body_points};
use super::pairs::arm_length_m;
use super::term::{Adjoint, Inputs, Term};
use super::validate::middle_and_half;
use dynident_model::{Model, Vec3};

#[derive(Clone, Debug)]
enum AllowedRegion {
    /// `|p[axis] - middle| / half - 1`.
    Slab { axis: usize, middle: f64, half: f64 },
    /// `(lowest - p_z) / length`.
    Above { lowest: f64, length: f64 },
    /// Constraint `1 - |p_xy - axis| / least`, or `(top - p_z) / least` if that is smaller: a point may be next to a
    /// column or above it.
    Outside { axis: [f64; 2], least: f64, top: f64 },
}

impl AllowedRegion {
    /// Critical point on the straight path from `here` to `next`, and its share of the path: for a column the point
    /// nearest to the axis, otherwise `here`.
    fn nearest(&self, here: Vec3, next: Option<Vec3>) -> (Vec3, f64) {
        let (Self::Outside { axis, least, top }, Some(next)) = (self, next) else { return (here, 0.0) };
        let (x, y) = (here[0] - axis[0], here[1] - axis[1]);
        let (dx, dy) = (next[0] - here[0], next[1] - here[1]);
        let length = dx * dx + dy * dy;
        let share = if length > 0.0 { (-(x * dx + y * dy) / length).clamp(0.0, 1.0) } else { 0.0 };
        // The height of the lower end of the path decides whether the whole path is above the column.
        let place = Vec3([here[0] + share * dx, here[1] + share * dy, here[2].min(next[2])]);
        let beside = 1.0 - (place[0] - axis[0]).hypot(place[1] - axis[1]) / least;
        let above = (top - place[2]) / least;
        (place, if beside <= above { share } else { f64::from(u8::from(next[2] < here[2])) })
    }

    fn value(&self, place: Vec3) -> (f64, Vec3) {
        let mut gradient = Vec3::ZERO;
        let value = match *self {
            Self::Slab { axis, middle, half } => {
                gradient[axis] = (place[axis] - middle).signum() / half;
                (place[axis] - middle).abs() / half - 1.0
            }
            Self::Above { lowest, length } => {
                gradient[2] = -1.0 / length;
                (lowest - place[2]) / length
            }
            Self::Outside { axis, least, top } => {
                let (x, y) = (place[0] - axis[0], place[1] - axis[1]);
                let distance = x.hypot(y);
                // On the axis the direction is arbitrary.
                let (nx, ny) = if distance > 0.0 { (x / distance, y / distance) } else { (1.0, 0.0) };
                let (beside, above) = (1.0 - distance / least, (top - place[2]) / least);
                gradient = if beside <= above {
                    Vec3([-nx / least, -ny / least, 0.0])
                } else {
                    Vec3([0.0, 0.0, -1.0 / least])
                };
                beside.min(above)
            }
        };
        (value, gradient)
    }
}

/// Position of a point at a sample, and at the next one if samples are consecutive.
fn path(inputs: &Inputs<'_>, point: &BodyPoint, sample: usize) -> (Vec3, Option<Vec3>) {
    let at = |sample| inputs.placement(point.body, sample).point(point.at);
    let follows = inputs.is_continuous && sample + 1 < inputs.motion.samples;
    (at(sample), follows.then(|| at(sample + 1)))
}

#[derive(Clone, Debug)]
pub(crate) struct PlaceLimits(Vec<(BodyPoint, AllowedRegion, Constraint)>);

impl PlaceLimits {
    pub(crate) fn boxed(model: &Model, limit: &BoxLimit) -> Result<Self, LimitError> {
        let mut rows = Vec::new();
        for point in body_points(model, &limit.points, "a box")? {
            for (axis, ends) in [limit.x_m, limit.y_m, limit.z_m].into_iter().enumerate() {
                let Some(ends) = ends else { continue };
                let (middle, half) = middle_and_half(ends);
                let half = half - point.radius_m;
                let subject = format!("{}, {}", point.name, ["x", "y", "z"][axis]);
                let constraint = Constraint { kind: LimitKind::Box, subject, middle, size: half, unit: "m" };
                rows.push((point.clone(), AllowedRegion::Slab { axis, middle, half }, constraint));
            }
        }
        Ok(Self(rows))
    }

    /// Floor limits: one row per point, scaled by the arm's length.
    pub(crate) fn floor(model: &Model, limit: &FloorLimit) -> Result<Self, LimitError> {
        if limit.points.is_empty() && !limit.shapes.is_empty() {
            return Ok(Self(Vec::new()));
        }
        let length = arm_length_m(model).max(1e-9);
        let row = |point: BodyPoint| {
            let lowest = limit.height_m + point.radius_m;
            let subject = point.name.clone();
            let constraint = Constraint { kind: LimitKind::Floor, subject, middle: lowest, size: length, unit: "m" };
            (point, AllowedRegion::Above { lowest, length }, constraint)
        };
        Ok(Self(body_points(model, &limit.points, "the floor")?.into_iter().map(row).collect()))
    }

    pub(crate) fn column(model: &Model, limit: &ColumnLimit) -> Result<Self, LimitError> {
        let row = |point: BodyPoint| {
            let least = limit.radius_m + point.radius_m;
            let subject = point.name.clone();
            let constraint = Constraint { kind: LimitKind::Column, subject, middle: 0.0, size: least, unit: "m" };
            let top = limit.height_m.map_or(f64::INFINITY, |height| height + point.radius_m);
            (point, AllowedRegion::Outside { axis: limit.axis_xy_m, least, top }, constraint)
        };
        Ok(Self(body_points(model, &limit.points, "the column")?.into_iter().map(row).collect()))
    }
}

impl Term for PlaceLimits {
    fn constraints(&self) -> Vec<Constraint> {
        self.0.iter().map(|(_, _, constraint)| constraint.clone()).collect()
    }

    fn values(&self, inputs: &Inputs<'_>, out: &mut [f64]) {
        for ((point, region, _), row) in self.0.iter().zip(out.chunks_exact_mut(inputs.motion.samples)) {
            for (sample, c) in row.iter_mut().enumerate() {
                let (here, next) = path(inputs, point, sample);
                *c = region.value(region.nearest(here, next).0).0;
            }
        }
    }

    fn apply_adjoint(&self, inputs: &Inputs<'_>, weights: &[f64], adjoint: &mut Adjoint<'_>) {
        for ((point, region, _), row) in self.0.iter().zip(weights.chunks_exact(inputs.motion.samples)) {
            for (sample, &weight) in row.iter().enumerate() {
                if weight != 0.0 {
                    let (here, next) = path(inputs, point, sample);
                    let (place, share) = region.nearest(here, next);
                    let gradient = region.value(place).1.scale(weight);
                    let bodies = inputs.bodies;
                    // The nearest point moves with both ends of the path; its displacement along the path has no
                    // effect to first order.
                    adjoint.point(point.body, bodies, sample, here, gradient.scale(1.0 - share));
                    if let Some(next) = next {
                        adjoint.point(point.body, bodies, sample + 1, next, gradient.scale(share));
                    }
                }
            }
        }
    }

    fn needs_placements(&self) -> bool {
        true
    }
}
