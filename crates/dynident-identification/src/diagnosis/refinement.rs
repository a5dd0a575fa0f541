//! Search for the best number of a mistake, and for the range of numbers that the logs do not distinguish from it.

use super::hypothesis::{CorrectedStudy, Explained, Hypothesis};
use super::mistakes::Mistake;
use super::step_width::with_widths;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;

/// Number of position units for which a physically consistent fit is computed: those with the smallest residuals of the
/// unconstrained fit.
const MAX_FITTED_UNITS: usize = 4;
/// Step of the search for the range of a factor, as the logarithm of the factor.
const RANGE_STEP: f64 = 0.2;
/// Distance to which the range of a sample rate is searched, as the logarithm of the factor: a decimal place.
const RATE_REACH: f64 = core::f64::consts::LN_10;
/// Accuracy of the ends of the range of a factor, as the logarithm of the factor.
const RANGE_ACCURACY: f64 = 0.03;

/// The hypothesis with a better number of its last mistake; `None` if its number is already the best. `at` is the study
/// before this mistake is corrected.
pub(super) fn refined(at: &CorrectedStudy, first: &Explained, consistency: &ConsistencySettings) -> Option<Explained> {
    let last = first.hypothesis.mistakes.last()?;
    // With positions in a smaller unit, a wide smoothed friction sign becomes narrow. Therefore its width is fitted for
    // each unit.
    let facts = last.facts();
    if facts.position_factor.is_some() {
        return refined_with_own_steps(at, last, consistency);
    }
    // The fit without physical constraints is smooth and cheap. Errors of the nominal masses would bias a torque gain.
    let value = |hypothesis: &Hypothesis| match facts.torque_gain {
        Some(_) => hypothesis.free_score(),
        None => hypothesis.lower_bound(),
    };
    let free = |mistake: &Mistake| at.without(mistake).hypothesis(None).map_or(f64::INFINITY, |found| value(&found));
    // A free number partly fits the noise. Therefore a round number is kept unless the free number is clearly better.
    let is_better = |found: &Explained| {
        if facts.number.is_none_or(|number| number.is_round) {
            found.hypothesis.score() < first.hypothesis.score() - at.settings.score.min_gain
        } else {
            value(&found.hypothesis) < value(&first.hypothesis)
        }
    };
    let better = last.with_best_number(free).and_then(|better| at.without(&better).explained(consistency).ok());
    let better = better.filter(is_better);
    // A unit is preferred to another factor nearby, unless it is clearly worse.
    let unit = better.as_ref().and_then(|better| better.hypothesis.mistakes.last()?.nearest_unit());
    let unit = unit.and_then(|unit| at.without(&unit).explained(consistency).ok());
    let better = match (better, unit) {
        (Some(free), Some(unit)) if unit.hypothesis.score() < free.hypothesis.score() + at.settings.score.min_gain => {
            Some(unit)
        }
        (better, _) => better,
    };
    if !facts.is_other_rate {
        return better;
    }
    let mut best = better.unwrap_or_else(|| first.clone());
    let last = best.hypothesis.mistakes.last()?;
    best.hypothesis.factors_alike = factor_range(last, RATE_REACH, 2.0 * at.settings.score.min_gain, free);
    Some(best)
}

/// The hypothesis with the best unit of positions. For each unit, the widths of the smoothed friction signs are fitted
/// to the rows. Gear ratios and encoder counts are not round numbers; a round unit is kept unless another factor is
/// clearly better.
fn refined_with_own_steps(
    at: &CorrectedStudy,
    first: &Mistake,
    consistency: &ConsistencySettings,
) -> Option<Explained> {
    let explained =
        |mistake: &Mistake| at.without(mistake).with_fitted_steps().and_then(|study| study.explained(consistency)).ok();
    let as_tried = explained(first)?;
    let number = first.facts().number?;
    let bound = |mistake: &Mistake| free_bound(at, &as_tried.study.robot, first, mistake);
    // Physically inconsistent bodies can also explain positions in a unit that is too small. Therefore the physically
    // consistent fit selects among the minima.
    let found: Vec<Mistake> = if number.is_round {
        first.with_best_number(bound).into_iter().collect()
    } else {
        let minima = number.local_minima(|factor| bound(&first.with_number(factor)));
        minima.take(MAX_FITTED_UNITS).map(|factor| first.with_number(factor)).collect()
    };
    let best = found.iter().filter_map(explained);
    let best = best.min_by(|a, b| a.hypothesis.score().total_cmp(&b.hypothesis.score()));
    let needed = if number.is_round { at.settings.score.min_gain } else { 0.0 };
    let limit = as_tried.hypothesis.score() - needed;
    let mut best = best.filter(|best| best.hypothesis.score() < limit).unwrap_or(as_tried);
    let last = best.hypothesis.mistakes.last()?;
    // Unmodelled friction, or usual errors of the description, move the best factor by more than noise would. Therefore
    // twice `min_gain` is used.
    let max_increase = 2.0 * at.settings.score.min_gain;
    let value = |mistake: &Mistake| free_bound(at, &best.study.robot, last, mistake);
    best.hypothesis.factors_alike = factor_range(last, number.reach, max_increase, value);
    Some(best)
}

/// Lower bound of the score with positions in another unit. The widths of the friction signs are those of `robot` in
/// the unit of `of`, converted to the same velocities in the log.
fn free_bound(at: &CorrectedStudy, robot: &ParametricModel, of: &Mistake, mistake: &Mistake) -> f64 {
    let (facts, dof) = (mistake.facts(), robot.dof());
    let (Some(from), Some(factor)) = (of.facts().position_factor, facts.position_factor) else { return f64::INFINITY };
    let joints = mistake.joints(dof);
    let times: Vec<f64> = (0..dof).map(|joint| if joints.contains(&joint) { factor / from } else { 1.0 }).collect();
    let robot = with_widths(robot, &times).unwrap_or_else(|| robot.clone());
    let found = CorrectedStudy { robot, ..at.without(mistake) }.hypothesis(None);
    found.map_or(f64::INFINITY, |found| found.lower_bound())
}

/// Smallest and largest factor around that of `mistake` for which `value` increases by at most `max_increase`. The
/// search ends at a distance of `reach`, as the logarithm of the factor.
fn factor_range(mistake: &Mistake, reach: f64, max_increase: f64, value: impl Fn(&Mistake) -> f64) -> Option<[f64; 2]> {
    let factor = mistake.facts().number?.at;
    let at = |log: f64| value(&mistake.with_number(factor * log.exp()));
    let limit = at(0.0) + max_increase;
    let edge = |direction: f64| {
        let [mut inside, mut outside] = [0.0, RANGE_STEP];
        while outside < reach && at(direction * outside) <= limit {
            [inside, outside] = [outside, outside + RANGE_STEP];
        }
        while outside - inside > RANGE_ACCURACY {
            let middle = 0.5 * (inside + outside);
            if at(direction * middle) <= limit { inside = middle } else { outside = middle }
        }
        factor * (direction * inside).exp()
    };
    Some([edge(-1.0), edge(1.0)])
}
