//! The number of a mistake that explains the samples best, and the range of numbers that the logs do not distinguish
//! from it.

use super::hypothesis::{CLEARLY_BETTER, CorrectedStudy, Explained, Hypothesis};
use super::mistakes::Mistake;
use super::step_width::with_widths;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;

/// Improvement from which a number replaces a round one: as much as for a mistake.
const MIN_IMPROVEMENT: f64 = CLEARLY_BETTER;
/// Units of positions that are fitted, those with the least residuals of free parameters.
const MAX_VALLEYS: usize = 4;
/// Steps of a factor's logarithm in which its range is searched, and the accuracy of the ends.
const EDGE_STEP: f64 = 0.2;
const EDGE_WIDTH: f64 = 0.03;

/// The hypothesis with another number of its last mistake, if that explains the samples better. `at` is the study
/// before this mistake.
pub(super) fn refined(at: &CorrectedStudy, first: &Explained, consistency: &ConsistencySettings) -> Option<Explained> {
    let last = first.hypothesis.mistakes.last()?;
    // A smaller unit of positions makes a wide friction step narrow: each unit gets its own steps.
    let facts = last.facts();
    if facts.position_factor.is_some() {
        return refined_with_own_steps(at, last, consistency);
    }
    // By the fit without physical limits: smooth, and cheap. The described masses say as much of a torque's gain as
    // they err.
    let value = |hypothesis: &Hypothesis| match facts.torque_gain {
        Some(_) => hypothesis.free_score(),
        None => hypothesis.lower_bound(),
    };
    let free = |mistake: &Mistake| at.without(mistake).hypothesis(None).map_or(f64::INFINITY, |found| value(&found));
    let found = at.without(&last.between(free)?).explained(consistency).ok()?;
    // Free numbers follow the noise: a round number stays unless the exact one is clearly better.
    let is_better = if facts.number.is_none_or(|number| number.is_round) {
        found.hypothesis.score() < first.hypothesis.score() - MIN_IMPROVEMENT
    } else {
        value(&found.hypothesis) < value(&first.hypothesis)
    };
    is_better.then_some(found)
}

/// The hypothesis with positions in the unit that explains most, where each unit has the friction steps that fit its
/// own rows. Gears and counts of encoders have no round number; a unit stays unless another is clearly better.
fn refined_with_own_steps(
    at: &CorrectedStudy,
    first: &Mistake,
    consistency: &ConsistencySettings,
) -> Option<Explained> {
    let explained =
        |mistake: &Mistake| at.without(mistake).with_own_steps().and_then(|study| study.explained(consistency)).ok();
    let as_tried = explained(first)?;
    let number = first.facts().number?;
    let bound = |mistake: &Mistake| free_bound(at, &as_tried.study.robot, first, mistake);
    // Inconsistent bodies explain positions in a unit that is too small as well, so the consistent fit selects the
    // valley.
    let found: Vec<Mistake> = if number.is_round {
        first.between(bound).into_iter().collect()
    } else {
        let valleys = number.valleys(|factor| bound(&first.with_number(factor)));
        valleys.take(MAX_VALLEYS).map(|factor| first.with_number(factor)).collect()
    };
    let best = found.iter().filter_map(explained);
    let best = best.min_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()));
    let needed = if number.is_round { MIN_IMPROVEMENT } else { 0.0 };
    let limit = as_tried.hypothesis.score() - needed;
    let mut best = best.filter(|best| best.hypothesis.score() < limit).unwrap_or(as_tried);
    let last = best.hypothesis.mistakes.last()?;
    best.hypothesis.factors_alike = factors_alike(last, |mistake| free_bound(at, &best.study.robot, last, mistake));
    Some(best)
}

/// Lower bound of the score with positions in another unit. The friction steps are those that `robot` has in the unit
/// of `of`, at the same velocities of the log.
fn free_bound(at: &CorrectedStudy, robot: &ParametricModel, of: &Mistake, mistake: &Mistake) -> f64 {
    let (facts, dof) = (mistake.facts(), robot.dof());
    let (Some(from), Some(factor)) = (of.facts().position_factor, facts.position_factor) else { return f64::INFINITY };
    let joints = mistake.joints(dof);
    let times: Vec<f64> = (0..dof).map(|joint| if joints.contains(&joint) { factor / from } else { 1.0 }).collect();
    let robot = with_widths(robot, &times).unwrap_or_else(|| robot.clone());
    let found = CorrectedStudy { robot, ..at.without(mistake) }.hypothesis(None);
    found.map_or(f64::INFINITY, |found| found.lower_bound())
}

/// Least and greatest factor of positions around that of `mistake` that explain the samples not clearly worse. Other
/// friction, or usual errors of the description, move the best factor by more than [`CLEARLY_BETTER`] does.
fn factors_alike(mistake: &Mistake, value: impl Fn(&Mistake) -> f64) -> Option<[f64; 2]> {
    let facts = mistake.facts();
    let (factor, reach) = (facts.position_factor?, facts.number?.reach);
    let at = |log: f64| value(&mistake.with_number(factor * log.exp()));
    let limit = at(0.0) + 2.0 * CLEARLY_BETTER;
    let edge = |direction: f64| {
        let [mut inside, mut outside] = [0.0, EDGE_STEP];
        while outside < reach && at(direction * outside) <= limit {
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
