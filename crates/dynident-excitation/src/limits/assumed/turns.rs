//! Assumed position limits of revolute joints without position limits.

use super::super::description::Limits;
use super::words::listed;
use core::f64::consts::PI;
use dynident_model::Model;

/// Known positions before a motion, rad (m), one per joint in the model's order; empty if unknown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartPositions {
    /// Positions at the start of the motion.
    pub start: Vec<Option<f64>>,
    /// Positions at which the robot waits before the motion.
    pub home: Vec<Option<f64>>,
}

/// Limits the positions of revolute joints that neither the robot description nor `given` limits. Returns a sentence
/// about them.
pub(super) fn bound_turns(
    under: &mut Limits,
    given: &Limits,
    model: &Model,
    turns: f64,
    starts: &StartPositions,
) -> Option<String> {
    if turns <= 0.0 {
        return None;
    }
    let mut bounded = Vec::new();
    for (place, joint) in model.joints().iter().enumerate() {
        let Some(limit) = under.joints.iter_mut().find(|limit| limit.joint == joint.name) else { continue };
        let is_given = given.of(&joint.name).is_some_and(|own| own.position.is_some());
        if !joint.is_rotary() || is_given || limit.position.is_some() {
            continue;
        }
        let known = |of: &[Option<f64>]| of.get(place).copied().flatten();
        // With half of the turns to either side of a free start, any two positions are at most `turns` apart.
        let (about, reach) = match known(&starts.start) {
            Some(start) => (start, 2.0 * PI * turns),
            None => (known(&starts.home).unwrap_or(0.0), PI * turns),
        };
        limit.position = Some([about - reach, about + reach]);
        bounded.push(joint.name.clone());
    }
    (!bounded.is_empty()).then(|| {
        format!(
            "joints without position limits move at most {turns} turn(s) from their start: {} (defaults.continuous_turns)",
            listed(&bounded)
        )
    })
}
