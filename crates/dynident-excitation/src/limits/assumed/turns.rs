//! How far turning joints without position limits may turn.

use super::super::description::Limits;
use super::words::listed;
use core::f64::consts::PI;
use dynident_model::Model;

/// Positions that are known before a motion, rad (m), joint by joint in the model's order; empty where none is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StartPositions {
    /// Where the motion starts.
    pub start: Vec<Option<f64>>,
    /// Where the robot waits before it.
    pub home: Vec<Option<f64>>,
}

/// Limits the positions of turning joints that neither the description nor `given` limits. Returns a sentence about
/// them.
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
        if !joint.turns() || is_given || limit.position.is_some() {
            continue;
        }
        let known = |of: &[Option<f64>]| of.get(place).copied().flatten();
        // Any two positions of half the turns about a free start are no further apart than all of them.
        let (about, reach) = match known(&starts.start) {
            Some(start) => (start, 2.0 * PI * turns),
            None => (known(&starts.home).unwrap_or(0.0), PI * turns),
        };
        limit.position = Some([about - reach, about + reach]);
        bounded.push(joint.name.clone());
    }
    (!bounded.is_empty()).then(|| {
        format!(
            "joints without position limits turn at most {turns} turn(s) away from where they start: {} (defaults.continuous_turns)",
            listed(&bounded)
        )
    })
}
