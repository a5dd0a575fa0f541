//! A reading whose mistake has the number that explains the samples best, and which others they cannot tell from it.

use super::mistake::Mistake;
use super::numbers::{REACH_OF_UNITS, between_those_tried, valleys};
use super::reading::{CLEARLY_BETTER, Corrected, Reading};
use super::step_width::{with_steps_of, with_widths};
use super::units::{is_unit_of_position, is_unit_of_torque};
use crate::consistent::ConsistencySettings;
use core::f64::consts::FRAC_PI_2;
use dynident_dynamics::ParametricModel;

/// By how much a number between those tried must be better than the nearest of these: as much as a mistake.
const WORTH_REFINING: f64 = CLEARLY_BETTER;
/// Steps of a factor's logarithm in which it is followed to where it explains clearly less, and how exactly that is
/// found.
const EDGE_STEP: f64 = 0.2;
const EDGE_WIDTH: f64 = 0.03;

/// A reading whose number lies between those tried.
pub(super) fn refined(
    at: &Corrected,
    first: &(Corrected, Reading),
    consistency: &ConsistencySettings,
) -> Option<(Corrected, Reading)> {
    let last = first.1.mistakes.last()?;
    // A smaller unit of positions makes a wide step of dry friction narrow: each is read with its own steps.
    if matches!(last, Mistake::PositionUnit { .. }) {
        return refined_with_own_steps(at, last, consistency);
    }
    // By the fit without physical limits: smooth, and cheap.
    // Of a torque's gain the description's masses say as much as these err.
    let value = |reading: &Reading, mistake: &Mistake| match mistake {
        Mistake::TorqueUnit { .. } => reading.free_score,
        _ => reading.lower_bound(),
    };
    let free =
        |mistake: &Mistake| at.without(mistake).reading(None).map_or(f64::INFINITY, |reading| value(&reading, mistake));
    let mistake = between_those_tried(last, free)?;
    let corrected = at.without(&mistake);
    let reading = corrected.reading(Some(consistency)).ok()?;
    // Free numbers follow the noise: the round one stays unless the exact one is clearly better.
    let is_round = match last {
        Mistake::TorqueUnit { factor, .. } => is_unit_of_torque(*factor),
        // Zeros are mistaken by quarters of a turn, or by anything.
        Mistake::Offset { offset_rad, .. } => (offset_rad / FRAC_PI_2).fract() == 0.0,
        _ => true,
    };
    let is_better = match mistake {
        _ if is_round => reading.score() < first.1.score() - WORTH_REFINING,
        _ => value(&reading, &mistake) < value(&first.1, &mistake),
    };
    is_better.then_some((corrected, reading))
}

/// The reading of positions in the unit that explains most where each unit is read with the steps of dry friction that
/// its own rows ask for. Gears and counts of encoders have no round number; a unit stays unless another is clearly
/// better.
fn refined_with_own_steps(
    at: &Corrected,
    first: &Mistake,
    consistency: &ConsistencySettings,
) -> Option<(Corrected, Reading)> {
    let read = |mistake: &Mistake| {
        let corrected = at.without(mistake);
        let robot = with_steps_of(&corrected.robot, &corrected.rows).ok()?;
        let corrected = Corrected { robot, ..corrected };
        corrected.reading(Some(consistency)).ok().map(|reading| (corrected, reading))
    };
    let as_tried = read(first)?;
    // Bodies that cannot be explain positions in a unit that is too small as well: of several valleys the one counts
    // that a robot is in.
    let of_first = |mistake: &Mistake| free_bound(at, (&as_tried.0.robot, first), mistake);
    let found = valleys(first, of_first).into_iter().filter_map(|mistake| read(&mistake));
    let best = found.min_by(|a, b| a.1.score().total_cmp(&b.1.score()));
    let is_round = matches!(first, Mistake::PositionUnit { factor, .. } if is_unit_of_position(*factor));
    let has_to_gain = if is_round { WORTH_REFINING } else { 0.0 };
    let is_better = |best: &(Corrected, Reading)| best.1.score() < as_tried.1.score() - has_to_gain;
    let (corrected, mut reading) = best.filter(is_better).unwrap_or(as_tried);
    let last = reading.mistakes.last()?;
    reading.factors_alike = factors_alike(last, |mistake| free_bound(at, (&corrected.robot, last), mistake));
    Some((corrected, reading))
}

/// The least score of a reading with positions in another unit, with the steps of dry friction that `robot` has in the
/// unit of `of`: these lie at the same velocities of the log.
fn free_bound(at: &Corrected, (robot, of): (&ParametricModel, &Mistake), mistake: &Mistake) -> f64 {
    let (Mistake::PositionUnit { factor: from, .. }, Mistake::PositionUnit { joints, factor }) = (of, mistake) else {
        return f64::INFINITY;
    };
    let times: Vec<f64> =
        (0..robot.dof()).map(|joint| if joints.contains(&joint) { factor / from } else { 1.0 }).collect();
    let robot = with_widths(robot, &times).unwrap_or_else(|| robot.clone());
    let reading = Corrected { robot, ..at.without(mistake) }.reading(None);
    reading.map_or(f64::INFINITY, |reading| reading.lower_bound())
}

/// The least and the greatest factor of positions around that of `mistake` that explain not clearly worse. A robot
/// that rubs otherwise, or is described with usual errors, moves the best one by more than [`CLEARLY_BETTER`] does.
fn factors_alike(mistake: &Mistake, value: impl Fn(&Mistake) -> f64) -> Option<[f64; 2]> {
    let Mistake::PositionUnit { joints, factor } = mistake else { return None };
    let at = |log: f64| value(&Mistake::PositionUnit { joints: joints.clone(), factor: factor * log.exp() });
    let limit = at(0.0) + 2.0 * CLEARLY_BETTER;
    let edge = |direction: f64| {
        let [mut inside, mut outside] = [0.0, EDGE_STEP];
        while outside < REACH_OF_UNITS && at(direction * outside) <= limit {
            [inside, outside] = [outside, outside + EDGE_STEP];
        }
        while outside - inside > EDGE_WIDTH {
            let middle = 0.5 * (inside + outside);
            if at(direction * middle) <= limit { inside = middle } else { outside = middle }
        }
        factor * (direction * inside).exp()
    };
    Some([edge(-1.0), edge(1.0)])
}
