//! Assumed floor below the base.

use super::super::description::FloorLimit;
use super::super::error::LimitError;
use super::super::pairs::{arm_length_m, neutral_posture, random_postures};
use super::super::self_collision_shapes::LinkShape;
use super::super::solids::LinkSolid;
use super::AssumptionThresholds;
use super::shapes::ShapesOfLinks;
use dynident_dynamics::{Workspace, body_placements};
use dynident_model::{Model, Transform};

const POSTURES: usize = 256;

/// Assumed floor below a machine that stands on its base, with the sentence for the report. The floor is at z = 0 of
/// the base frame, or at the lowest point of the base's own shapes if that is lower. The inner error is the reason
/// why no floor is assumed.
pub(super) fn assumed_floor(
    model: &Model,
    shapes: &ShapesOfLinks,
    given: Option<&FloorLimit>,
    clearance_m: f64,
    thresholds: &AssumptionThresholds,
) -> Result<Result<(FloorLimit, Option<String>), String>, LimitError> {
    if given.is_some() {
        return Ok(Err("the study defines it".to_owned()));
    }
    if shapes.shapes.is_empty() {
        return Ok(Err("the robot description has no shapes".to_owned()));
    }
    let gravity = model.gravity();
    let weight = gravity.norm();
    if weight <= 0.0 {
        return Ok(Err("gravity is zero, so that down is undefined".to_owned()));
    }
    let leaning = gravity[0].hypot(gravity[1]) / weight;
    if leaning > thresholds.max_gravity_tilt || gravity[2] > 0.0 {
        let fix = "set design.limits.floor or design.limits.boxes";
        return Ok(Err(format!("the base is mounted on a wall or ceiling; {fix}")));
    }
    let solids = LinkSolid::gather(model, &shapes.shapes, "the floor")?;
    let at = Transform::IDENTITY;
    let base = solids.iter().filter(|solid| solid.body.is_none());
    // If a capsule replaces the shapes of the base, the capsule ends at the base frame; its radius is not part of the
    // base.
    let real = |solid: &&LinkSolid| !shapes.stand_ins.contains(&solid.link);
    let plane_m = base.filter(real).map(|solid| solid.lowest(&at).0).fold(0.0, f64::min);
    let mut workspace = Workspace::new(model);
    let placements = body_placements(model, &mut workspace, &neutral_posture(model));
    let moving = solids.iter().filter_map(|solid| Some((solid, solid.body?)));
    let lowest = moving.map(|(solid, body)| solid.lowest(&placements[body]).0).fold(f64::INFINITY, f64::min);
    if lowest < plane_m - thresholds.max_depth_below_base * arm_length_m(model) {
        let fix = "set design.limits.floor if there is a floor";
        return Ok(Err(format!("the machine extends below its base (a leg, a torso, a rig); {fix}")));
    }
    let mut floor = FloorLimit { height_m: plane_m + clearance_m, ..FloorLimit::default() };
    over_all_shapes(model, shapes, &mut floor)?;
    let words = format!(
        "floor: the links stay {clearance_m:.3} m above the plane z = {plane_m:.3} m of the base frame, on which the base is assumed to stand (defaults.floor)"
    );
    Ok(Ok((floor, Some(words))))
}

pub(super) fn over_all_shapes(model: &Model, shapes: &ShapesOfLinks, floor: &mut FloorLimit) -> Result<(), LimitError> {
    let solids = LinkSolid::gather(model, &shapes.shapes, "the floor")?;
    let moving: Vec<(&LinkSolid, usize)> = solids.iter().filter_map(|solid| Some((solid, solid.body?))).collect();
    let mut highest = vec![f64::NEG_INFINITY; moving.len()];
    let mut workspace = Workspace::new(model);
    for q in core::iter::once(neutral_posture(model)).chain(random_postures(model, POSTURES)) {
        let placements = body_placements(model, &mut workspace, &q);
        for ((solid, body), highest) in moving.iter().zip(&mut highest) {
            *highest = highest.max(solid.lowest(&placements[*body]).0);
        }
    }
    for ((solid, _), highest) in moving.iter().zip(&highest) {
        let missing_m = floor.height_m - highest;
        if missing_m > 0.0 && !floor.lowered_m.contains_key(&solid.link) {
            floor.lowered_m.insert(solid.link.clone(), missing_m);
        }
    }
    let is_moving = |shape: &&LinkShape| moving.iter().any(|(solid, _)| solid.link == shape.link);
    floor.shapes = shapes.shapes.iter().filter(is_moving).cloned().collect();
    Ok(())
}
