//! The last word on limits: every limit looked at again, sample by sample, by code that shares nothing with the
//! optimiser's.
//!
//! Plain loops over the description: names are looked up here, torques come from single-sample inverse dynamics and the
//! exact known torque of friction and drives (the worst case at rest), distances of links from another algorithm than
//! the search's. Only the choice of shapes and their pairs, which is part of what the limit *is*, comes from
//! [`SelfCollision`](crate::limits::SelfCollision).

mod apart;

use crate::limits::{JointLimit, LimitError, LimitKind, Limits, LinkPoint, LinkShape};
use crate::motion::Motion;
use apart::{Hull, Link, Pair};
use dynident_dynamics::{Workspace, body_placements, inverse_dynamics};
use dynident_model::{Body, Model, Transform, Vec3};
use serde::{Deserialize, Serialize};

/// A ratio above 1 by more than this is a violation.
pub const VIOLATION: f64 = 1e-6;

/// The rate that the project checks motions of usual arms at; of others by [`OwnScale::round_hertz`], so that a motion
/// of a watch or a crane is looked at as often.
///
/// [`OwnScale::round_hertz`]: dynident_model::OwnScale::round_hertz
pub const CHECK_RATE_HZ: f64 = 10_000.0;

/// Most samples that a check looks at: a bound on its time (some minutes), not on memory.
const MOST_SAMPLES: f64 = 1e8;

/// Samples asked from the motion at once.
const BLOCK: usize = 1000;

/// How near a motion comes to one limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LimitReport {
    /// What is limited.
    pub kind: LimitKind,
    /// The joint; for places the point, for self-collision the pair of links.
    pub joint: String,
    /// 1 on the limit, above it in violation: `|x - middle| / half range`, `|x| / limit`; for a column `2 - distance /
    /// least`, for two links 1 plus the lack of distance as a share of their radii and clearance (of 5 % of the arm's
    /// length at least), for the floor 1 plus the arm's lengths below it. Infinite if the motion is not finite: in
    /// JSON the largest number, 1.8e308.
    #[serde(serialize_with = "largest_for_infinite", deserialize_with = "infinite_for_largest")]
    #[cfg_attr(feature = "schema", schemars(with = "f64"))]
    pub worst_ratio: f64,
    /// When the ratio is worst, s.
    pub at_s: f64,
    /// True if the limit is broken by more than [`VIOLATION`].
    pub violated: bool,
}

/// A ratio as JSON has it, which knows no infinity.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the shape that serde wants")]
fn largest_for_infinite<S: serde::Serializer>(ratio: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(ratio.min(f64::MAX))
}

/// A ratio from JSON; files of earlier versions have null for infinity.
fn infinite_for_largest<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.filter(|ratio| *ratio < f64::MAX).unwrap_or(f64::INFINITY))
}

/// What is checked at each sample.
enum Probe {
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

struct Point {
    body: Option<usize>,
    at: Vec3,
    radius_m: f64,
}

/// Checks all limits from 0 to `duration_s` at `rate_hz` ([`CHECK_RATE_HZ`]), the end included. `motion` gives the
/// exact motion at a list of times.
///
/// # Errors
/// As [`Limits::validate`]; a duration or rate that is not positive and finite, or more than 10⁸ samples.
pub fn check_limits(
    limits: &Limits,
    model: &Model,
    duration_s: f64,
    rate_hz: f64,
    motion: impl FnMut(&[f64], &mut Motion),
) -> Result<Vec<LimitReport>, LimitError> {
    Ok(check_limits_until(limits, model, duration_s, rate_hz, motion, &|| false)?.unwrap_or_default())
}

/// [`check_limits()`] at duration (s) and rate (Hz), which ends without a report once `stop` says so. It is asked every
/// 1000 samples.
///
/// # Errors
/// As [`check_limits()`].
pub fn check_limits_until(
    limits: &Limits,
    model: &Model,
    duration_s: f64,
    rate_hz: f64,
    mut motion: impl FnMut(&[f64], &mut Motion),
    stop: &dyn Fn() -> bool,
) -> Result<Option<Vec<LimitReport>>, LimitError> {
    limits.validate(model)?;
    for (what, value) in [("duration", duration_s), ("rate", rate_hz)] {
        if !value.is_finite() || value <= 0.0 {
            return Err(LimitError::NotPositive { what: format!("{what} of the check"), value });
        }
    }
    let steps = (duration_s * rate_hz).ceil();
    if steps >= MOST_SAMPLES {
        let what = "number of samples of the check".to_owned();
        return Err(LimitError::OutOfRange { what, value: steps, at_least: 1.0, below: MOST_SAMPLES });
    }
    let steps = steps as usize;
    let mut probes = probes(limits, model)?;
    let (mut workspace, mut kinematics) = (Workspace::new(model), Workspace::new(model));
    let (mut block, mut times) = (Motion::default(), Vec::with_capacity(BLOCK));
    let dof = model.dof();
    let mut state = vec![vec![0.0; dof]; 4];
    let mut torque = [vec![0.0; dof], vec![0.0; dof]];
    let mut start = 0;
    while start <= steps {
        if stop() {
            return Ok(None);
        }
        times.clear();
        times.extend((start..(start + BLOCK).min(steps + 1)).map(|step| (step as f64 / rate_hz).min(duration_s)));
        motion(&times, &mut block);
        for (sample, &at_s) in times.iter().enumerate() {
            for (state, from) in state.iter_mut().zip([&block.q, &block.dq, &block.ddq, &block.dddq]) {
                for (joint, to) in state.iter_mut().enumerate() {
                    *to = from[joint * times.len() + sample];
                }
            }
            let rigid = inverse_dynamics(model, &mut workspace, &state[0], &state[1], &state[2]);
            let [low, high] = &mut torque;
            limits.known_torque.range(rigid, [&state[0], &state[1], &state[2]], low, high);
            let placements = body_placements(model, &mut kinematics, &state[0]);
            for (probe, report) in &mut probes {
                let ratio = probe.ratio(&state, &torque, placements, report.worst_ratio);
                let ratio = if ratio.is_nan() { f64::INFINITY } else { ratio };
                if ratio > report.worst_ratio {
                    (report.worst_ratio, report.at_s) = (ratio, at_s);
                }
            }
        }
        start += BLOCK;
    }
    let finish = |(_, mut report): (Probe, LimitReport)| {
        report.violated = report.worst_ratio > 1.0 + VIOLATION;
        report
    };
    Ok(Some(probes.into_iter().map(finish).collect()))
}

fn probes(limits: &Limits, model: &Model) -> Result<Vec<(Probe, LimitReport)>, LimitError> {
    let mut probes = Vec::new();
    let mut add = |kind: LimitKind, joint: String, probe: Probe| {
        let report = LimitReport { kind, joint, worst_ratio: f64::NEG_INFINITY, at_s: 0.0, violated: false };
        probes.push((probe, report));
    };
    for limit in &limits.joints {
        let Some(joint) = model.joints().iter().position(|joint| joint.name == limit.joint) else { continue };
        let JointLimit { position, speed, acceleration, jerk, torque, torque_margin, power_w, .. } = limit;
        let name = || limit.joint.clone();
        if let Some([lower, upper]) = *position {
            add(LimitKind::Position, name(), Probe::Band { array: 0, joint, lower, upper });
        }
        let rates = [(LimitKind::Speed, speed), (LimitKind::Acceleration, acceleration), (LimitKind::Jerk, jerk)];
        for (array, (kind, limit)) in rates.into_iter().enumerate() {
            if let Some(limit) = *limit {
                add(kind, name(), Probe::Band { array: array + 1, joint, lower: -limit, upper: limit });
            }
        }
        if let Some(torque) = torque {
            add(LimitKind::Torque, name(), Probe::Torque { joint, limit: torque - torque * torque_margin });
        }
        if let Some(limit) = *power_w {
            add(LimitKind::Power, name(), Probe::Power { joint, limit });
        }
    }
    for (index, joint) in model.followers() {
        let Some(coupling) = model.coupling() else { continue };
        let sources = || coupling.row(index).to_vec();
        if let Some((lower, upper)) = joint.limits.lower.zip(joint.limits.upper).filter(|(lower, upper)| lower < upper)
        {
            let (offset, range) = (coupling.offset(index), [lower, upper]);
            add(
                LimitKind::Position,
                joint.name.clone(),
                Probe::Follower { array: 0, sources: sources(), offset, range },
            );
        }
        if let Some(most) = joint.limits.velocity.filter(|most| *most > 0.0) {
            let range = [-most, most];
            add(
                LimitKind::Speed,
                joint.name.clone(),
                Probe::Follower { array: 1, sources: sources(), offset: 0.0, range },
            );
        }
    }
    for limit in &limits.boxes {
        for (name, point) in points(model, &limit.points) {
            for (axis, (letter, ends)) in [("x", limit.x_m), ("y", limit.y_m), ("z", limit.z_m)].into_iter().enumerate()
            {
                if let Some([lower, upper]) = ends {
                    let point = Point { ..point };
                    add(LimitKind::Box, format!("{name}, {letter}"), Probe::Axis { point, axis, lower, upper });
                }
            }
        }
    }
    if let Some(floor) = &limits.floor {
        let length_m = arm_length_m(model);
        if floor.shapes.is_empty() || !floor.points.is_empty() {
            for (name, point) in points(model, &floor.points) {
                add(LimitKind::Floor, name, Probe::Floor { point, height_m: floor.height_m, length_m });
            }
        }
        for (name, link) in links(model, &floor.shapes) {
            let height_m = floor.height_m - floor.lowered_m.get(&name).copied().unwrap_or(0.0);
            add(LimitKind::Floor, name, Probe::FloorLink { link, height_m, length_m });
        }
    }
    if let Some(column) = &limits.column {
        let [x, y] = column.axis_xy_m;
        for (name, point) in points(model, &column.points) {
            let top_m = column.height_m.unwrap_or(f64::INFINITY);
            add(LimitKind::Column, name, Probe::Column { point, x, y, radius_m: column.radius_m, top_m });
        }
    }
    if let Some(limit) = &limits.self_collision {
        let resolved = limit.resolve(model)?;
        for pair in resolved.pairs {
            let solids = pair.of.map(|place| &resolved.solids[place]);
            let links = solids.map(|solid| {
                let hull = |corners: &Vec<Vec3>, radius_m| Hull { corners: corners.clone(), radius_m };
                let hulls = solid.shapes.iter().map(|shape| hull(&shape.corners, shape.radius_m));
                Link::new(solid.body, hulls.collect())
            });
            let name = solids.map(|solid| solid.link.as_str()).join(" / ");
            add(LimitKind::SelfCollision, name, Probe::Pair(Box::new(Pair::new(links, pair.clearance_m, pair.size_m))));
        }
    }
    Ok(probes)
}

/// Points and their names; of an empty list the origins of the moving bodies.
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

/// The longest chain of joints and frames from the base, m.
fn arm_length_m(model: &Model) -> f64 {
    let stroke = |body: usize| {
        let limits = model.tree_joints()[body].limits;
        let ends = limits.lower.zip(limits.upper).filter(|_| !model.tree_joints()[body].turns());
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

/// Links with shapes, in the order of the description's.
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

/// Where a point of a body stands in the base frame.
fn place(placements: &[Transform], body: Option<usize>, at: Vec3) -> Vec3 {
    body.map_or(at, |body| placements[body].rotation.mul_vec(at) + placements[body].translation)
}

/// How far `x` goes from the middle of its range, in halves of the range.
fn band(x: f64, lower: f64, upper: f64) -> f64 {
    let half = upper / 2.0 - lower / 2.0;
    ((x - lower) / half - 1.0).max((upper - x) / half - 1.0)
}

/// The larger magnitude of the lowest and the highest torque of a joint.
fn most(bounds: &[Vec<f64>; 2], joint: usize) -> f64 {
    let [low, high] = bounds;
    low[joint].abs().max(high[joint].abs())
}

impl Probe {
    /// The ratio at one sample. A pair that cannot reach the `worst` ratio so far gives that one.
    fn ratio(&mut self, state: &[Vec<f64>], torque: &[Vec<f64>; 2], placements: &[Transform], worst: f64) -> f64 {
        let at = |point: &Point| place(placements, point.body, point.at);
        match self {
            Self::Band { array, joint, lower, upper } => band(state[*array][*joint], *lower, *upper),
            Self::Follower { array, sources, offset, range: [lower, upper] } => {
                let followed = sources.iter().map(|&(joint, share)| share * state[*array][joint]);
                band(*offset + followed.sum::<f64>(), *lower, *upper)
            }
            Self::Torque { joint, limit } => most(torque, *joint) / *limit,
            Self::Power { joint, limit } => most(torque, *joint) * state[1][*joint].abs() / *limit,
            Self::Axis { point, axis, lower, upper } => {
                band(at(point)[*axis], *lower + point.radius_m, *upper - point.radius_m)
            }
            Self::Floor { point, height_m, length_m } => {
                1.0 + (*height_m - (at(point)[2] - point.radius_m)) / *length_m
            }
            Self::FloorLink { link, height_m, length_m } => {
                1.0 + link.below_m(placements, *height_m, (worst - 1.0) * *length_m) / *length_m
            }
            Self::Column { point, x, y, radius_m, top_m } => {
                let at = at(point);
                let distance = ((at[0] - *x) * (at[0] - *x) + (at[1] - *y) * (at[1] - *y)).sqrt();
                let least = *radius_m + point.radius_m;
                // Beside the column or above it, whichever is farther.
                (2.0 - distance / least).min(1.0 + (*top_m + point.radius_m - at[2]) / least)
            }
            Self::Pair(pair) => pair.ratio(placements, worst),
        }
    }
}
