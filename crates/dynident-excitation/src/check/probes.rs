//! Checks of each sample against the limits of a study, with names resolved in the robot description.

use super::LimitReport;
use super::apart::{Hull, Link, Pair};
use crate::limits::{FloorLimit, JointLimit, LimitError, LimitKind, Limits, LinkPoint, LinkShape, SelfCollision};
use dynident_model::{Body, Model, Transform, Vec3};

pub(super) enum Probe {
    Band { array: usize, joint: usize, lower: f64, upper: f64 },
    Follower { array: usize, sources: Vec<(usize, f64)>, offset: f64, range: [f64; 2] },
    Torque { joint: usize, limit: f64 },
    Power { joint: usize, limit: f64 },
    Axis { point: Point, axis: usize, lower: f64, upper: f64 },
    Floor { point: Point, height_m: f64, length_m: f64 },
    FloorLink { link: Link, height_m: f64, length_m: f64 },
    Column { point: Point, x: f64, y: f64, radius_m: f64, top_m: f64 },
    Pair(Box<Pair>),
}

pub(super) struct Point {
    body: Option<usize>,
    at: Vec3,
    radius_m: f64,
}

pub(super) fn probes(limits: &Limits, model: &Model) -> Result<Vec<(Probe, LimitReport)>, LimitError> {
    let mut probes = Probes(Vec::new());
    for limit in &limits.joints {
        if let Some(joint) = model.joints().iter().position(|joint| joint.name == limit.joint) {
            probes.add_joint(joint, limit);
        }
    }
    probes.add_followers(model);
    for limit in &limits.boxes {
        for (name, point) in points(model, &limit.points) {
            for (axis, (letter, ends)) in [("x", limit.x_m), ("y", limit.y_m), ("z", limit.z_m)].into_iter().enumerate()
            {
                if let Some([lower, upper]) = ends {
                    let point = Point { ..point };
                    probes.add(LimitKind::Box, format!("{name}, {letter}"), Probe::Axis { point, axis, lower, upper });
                }
            }
        }
    }
    if let Some(floor) = &limits.floor {
        probes.add_floor(model, floor);
    }
    if let Some(column) = &limits.column {
        let [x, y] = column.axis_xy_m;
        for (name, point) in points(model, &column.points) {
            let top_m = column.height_m.unwrap_or(f64::INFINITY);
            probes.add(LimitKind::Column, name, Probe::Column { point, x, y, radius_m: column.radius_m, top_m });
        }
    }
    if let Some(limit) = &limits.self_collision {
        probes.add_pairs(model, limit)?;
    }
    Ok(probes.0)
}

struct Probes(Vec<(Probe, LimitReport)>);

impl Probes {
    fn add(&mut self, kind: LimitKind, joint: String, probe: Probe) {
        let report = LimitReport { kind, joint, worst_ratio: f64::NEG_INFINITY, at_s: 0.0, violated: false };
        self.0.push((probe, report));
    }

    fn add_joint(&mut self, joint: usize, limit: &JointLimit) {
        let JointLimit { position, speed, acceleration, jerk, torque, torque_margin, power_w, .. } = limit;
        let name = || limit.joint.clone();
        if let Some([lower, upper]) = *position {
            self.add(LimitKind::Position, name(), Probe::Band { array: 0, joint, lower, upper });
        }
        let rates = [(LimitKind::Speed, speed), (LimitKind::Acceleration, acceleration), (LimitKind::Jerk, jerk)];
        for (array, (kind, limit)) in rates.into_iter().enumerate() {
            if let Some(limit) = *limit {
                self.add(kind, name(), Probe::Band { array: array + 1, joint, lower: -limit, upper: limit });
            }
        }
        if let Some(torque) = torque {
            self.add(LimitKind::Torque, name(), Probe::Torque { joint, limit: torque - torque * torque_margin });
        }
        if let Some(limit) = *power_w {
            self.add(LimitKind::Power, name(), Probe::Power { joint, limit });
        }
    }

    fn add_followers(&mut self, model: &Model) {
        for (index, joint) in model.followers() {
            let Some(coupling) = model.coupling() else { continue };
            let mut add = |kind, array, offset, range| {
                let probe = Probe::Follower { array, sources: coupling.row(index).to_vec(), offset, range };
                self.add(kind, joint.name.clone(), probe);
            };
            let ends = joint.limits.lower.zip(joint.limits.upper);
            if let Some((lower, upper)) = ends.filter(|(lower, upper)| lower < upper) {
                add(LimitKind::Position, 0, coupling.offset(index), [lower, upper]);
            }
            if let Some(max_magnitude) = joint.limits.velocity.filter(|max_magnitude| *max_magnitude > 0.0) {
                add(LimitKind::Speed, 1, 0.0, [-max_magnitude, max_magnitude]);
            }
        }
    }

    fn add_floor(&mut self, model: &Model, floor: &FloorLimit) {
        let length_m = arm_length_m(model);
        if floor.shapes.is_empty() || !floor.points.is_empty() {
            for (name, point) in points(model, &floor.points) {
                self.add(LimitKind::Floor, name, Probe::Floor { point, height_m: floor.height_m, length_m });
            }
        }
        for (name, link) in links(model, &floor.shapes) {
            let height_m = floor.height_m - floor.lowered_m.get(&name).copied().unwrap_or(0.0);
            self.add(LimitKind::Floor, name, Probe::FloorLink { link, height_m, length_m });
        }
    }

    fn add_pairs(&mut self, model: &Model, limit: &SelfCollision) -> Result<(), LimitError> {
        let resolved = limit.resolve(model)?;
        for pair in resolved.pairs {
            let solids = pair.of.map(|place| &resolved.solids[place]);
            let links = solids.map(|solid| {
                let hull = |corners: &Vec<Vec3>, radius_m| Hull { corners: corners.clone(), radius_m };
                let hulls = solid.shapes.iter().map(|shape| hull(&shape.corners, shape.radius_m));
                Link::new(solid.body, hulls.collect())
            });
            let name = solids.map(|solid| solid.link.as_str()).join(" / ");
            let probe = Probe::Pair(Box::new(Pair::new(links, pair.clearance_m, pair.size_m)));
            self.add(LimitKind::SelfCollision, name, probe);
        }
        Ok(())
    }
}

/// Points and their names; for an empty list, the origins of the moving bodies.
fn points(model: &Model, points: &[LinkPoint]) -> Vec<(String, Point)> {
    let mut found = Vec::new();
    let bodies = |body: usize| -> (Option<usize>, &Body) {
        body.checked_sub(1).map_or((None, model.base()), |index| (Some(index), &model.bodies()[index]))
    };
    for body in 0..=model.body_count() {
        let (index, body) = bodies(body);
        if points.is_empty() && index.is_some() {
            let name = body.links[0].name.clone();
            found.push((name, Point { body: index, at: Vec3([0.0; 3]), radius_m: 0.0 }));
        }
        for point in points {
            for link in body.links.iter().filter(|link| link.name == point.link) {
                let at = link.placement.rotation.mul_vec(Vec3(point.at_m)) + link.placement.translation;
                let [x, y, z] = point.at_m;
                let name = if point.at_m == [0.0; 3] {
                    link.name.clone()
                } else {
                    format!("{} at ({x}, {y}, {z})", link.name)
                };
                found.push((name, Point { body: index, at, radius_m: point.radius_m }));
            }
        }
    }
    found
}

/// Length of the longest chain of joints and frames from the base, m.
fn arm_length_m(model: &Model) -> f64 {
    let stroke = |body: usize| {
        let limits = model.tree_joints()[body].limits;
        let ends = limits.lower.zip(limits.upper).filter(|_| !model.tree_joints()[body].is_rotary());
        ends.map_or(0.0, |(lower, upper)| lower.abs().max(upper.abs()))
    };
    let to = |body: usize| -> f64 {
        model
            .path(body)
            .iter()
            .map(|&joint| model.tree_joints()[joint].placement.translation.norm() + stroke(joint))
            .sum()
    };
    let frames = |body: usize| model.bodies()[body].links.iter().map(|link| link.placement.translation.norm());
    (0..model.body_count()).map(|body| to(body) + frames(body).fold(0.0, f64::max)).fold(1e-9, f64::max)
}

/// Links with shapes, in the order of the robot description.
fn links(model: &Model, shapes: &[LinkShape]) -> Vec<(String, Link)> {
    let mut found: Vec<(String, Option<usize>, Vec<Hull>)> = Vec::new();
    for shape in shapes {
        let bodies = core::iter::once((None, model.base())).chain((0..).map(Some).zip(model.bodies()));
        let mut all = bodies.flat_map(|(body, of)| of.links.iter().map(move |link| (body, link)));
        let Some((body, link)) = all.find(|(_, link)| link.name == shape.link) else { continue };
        let place = |corner: &[f64; 3]| link.placement.rotation.mul_vec(Vec3(*corner)) + link.placement.translation;
        let hull = Hull { corners: shape.corners_m.iter().map(place).collect(), radius_m: shape.radius_m };
        match found.iter_mut().find(|(name, ..)| *name == shape.link) {
            Some((.., hulls)) => hulls.push(hull),
            None => found.push((shape.link.clone(), body, vec![hull])),
        }
    }
    found.into_iter().map(|(name, body, hulls)| (name, Link::new(body, hulls))).collect()
}

fn place(placements: &[Transform], body: Option<usize>, at: Vec3) -> Vec3 {
    body.map_or(at, |body| placements[body].rotation.mul_vec(at) + placements[body].translation)
}

/// Distance of `x` from the middle of its range, divided by half the range.
fn range_ratio(x: f64, lower: f64, upper: f64) -> f64 {
    let half = upper / 2.0 - lower / 2.0;
    ((x - lower) / half - 1.0).max((upper - x) / half - 1.0)
}

fn max_magnitude([low, high]: &[Vec<f64>; 2], joint: usize) -> f64 {
    low[joint].abs().max(high[joint].abs())
}

impl Probe {
    /// Ratio at one sample. Returns `worst` for a pair that cannot exceed this ratio.
    pub(super) fn ratio(
        &mut self,
        state: &[Vec<f64>],
        torque: &[Vec<f64>; 2],
        placements: &[Transform],
        worst: f64,
    ) -> f64 {
        let at = |point: &Point| place(placements, point.body, point.at);
        match self {
            Self::Band { array, joint, lower, upper } => range_ratio(state[*array][*joint], *lower, *upper),
            Self::Follower { array, sources, offset, range: [lower, upper] } => {
                let followed = sources.iter().map(|&(joint, share)| share * state[*array][joint]);
                range_ratio(*offset + followed.sum::<f64>(), *lower, *upper)
            }
            Self::Torque { joint, limit } => max_magnitude(torque, *joint) / *limit,
            Self::Power { joint, limit } => max_magnitude(torque, *joint) * state[1][*joint].abs() / *limit,
            Self::Axis { point, axis, lower, upper } => {
                range_ratio(at(point)[*axis], *lower + point.radius_m, *upper - point.radius_m)
            }
            Self::Floor { point, height_m, length_m } => {
                1.0 + (*height_m - (at(point)[2] - point.radius_m)) / *length_m
            }
            Self::FloorLink { link, height_m, length_m } => {
                1.0 + link.depth_below_m(placements, *height_m, (worst - 1.0) * *length_m) / *length_m
            }
            Self::Column { point, x, y, radius_m, top_m } => {
                let at = at(point);
                let distance = ((at[0] - *x) * (at[0] - *x) + (at[1] - *y) * (at[1] - *y)).sqrt();
                let least = *radius_m + point.radius_m;
                (2.0 - distance / least).min(1.0 + (*top_m + point.radius_m - at[2]) / least)
            }
            Self::Pair(pair) => pair.ratio(placements, worst),
        }
    }
}
