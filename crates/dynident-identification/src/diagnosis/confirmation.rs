//! Confirmation of a hypothesis against three causes that look like a mistake: another step of dry friction, a
//! description with usual errors, and placeholders for bodies, for which another rate compensates.

use super::error::DiagnosisError;
use super::hypothesis::{CLEARLY_BETTER, CorrectedStudy, Hypothesis, INDISTINGUISHABLE, NOMINAL_WEIGHT};
use super::joint_fits::score;
use super::mistakes::{Mistake, without_mistakes};
use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, nominal_torque};
use super::search::Search;
use super::step_width::with_steps_of;
use super::usual_errors::torques_of_likely_robots;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;

/// Improvement that another rate needs: rates of correct logs gain 1.1, other rates 2.0 and more.
const CLEARLY_ANOTHER_RATE: f64 = 2.0 * CLEARLY_BETTER;

/// Replaces the result of a search by the study as written, with the friction steps that its `rows` need, if the
/// hypothesis of the search is not confirmed, or if the search found no hypothesis and these steps differ from the
/// study's. `None` if the search stays as it is. `believed` is the study of the search's best hypothesis.
///
/// # Errors
/// Too few rows.
pub(super) fn as_written_instead(
    robot: &ParametricModel,
    rows: &MotionRows,
    believed: &(ParametricModel, MotionRows),
    search: &Search,
    consistency: &ConsistencySettings,
) -> Result<Option<(ParametricModel, Search)>, DiagnosisError> {
    let own_steps = with_steps_of(robot, rows)?;
    if search.best.is_none() && own_steps.terms() == robot.terms() {
        return Ok(None);
    }
    let study = CorrectedStudy::new(own_steps.clone(), rows.clone(), Vec::new());
    let as_written = study.hypothesis(Some(consistency))?;
    if let Some(best) = &search.best {
        let (robot_of_best, rows_of_best) = believed;
        let robot_of_best = with_steps_of(robot_of_best, rows_of_best)?;
        let study = CorrectedStudy::new(robot_of_best, rows_of_best.clone(), best.mistakes.clone());
        let study = CorrectedStudy { torque_growth: best.torque_growth, ..study };
        let best = study.hypothesis(Some(consistency))?;
        if is_clear(&as_written, &best) && is_beyond_usual_errors(robot, rows, &as_written, &best) {
            return Ok(None);
        }
    }
    Ok(Some((own_steps, Search { as_written, best: None, alike: Vec::new(), tried: search.tried })))
}

/// Whether a hypothesis is better where each has its own steps. Placeholders support another rate as much as described
/// bodies do, so the consistent fit has to improve.
fn is_clear(as_written: &Hypothesis, best: &Hypothesis) -> bool {
    let gain = as_written.score() - best.score();
    if best.mistakes.iter().all(|mistake| mistake.facts().is_other_rate) {
        gain >= CLEARLY_ANOTHER_RATE && as_written.consistent_score() - best.consistent_score() >= INDISTINGUISHABLE
    } else {
        gain >= CLEARLY_BETTER
    }
}

/// Whether a hypothesis that only the described bodies support gains clearly more than with any robot that is described
/// with usual errors, moved as in these rows and without any mistake.
fn is_beyond_usual_errors(
    robot: &ParametricModel,
    rows: &MotionRows,
    as_written: &Hypothesis,
    best: &Hypothesis,
) -> bool {
    let by_bodies = as_written.nominal_score() - best.nominal_score();
    if as_written.score() - best.score() - NOMINAL_WEIGHT * by_bodies >= CLEARLY_BETTER {
        return true;
    }
    let (Some(torques), Some(nominal)) = (torques_of_likely_robots(robot, rows), nominal_torque(robot, rows)) else {
        return true;
    };
    let of = |robot: &ParametricModel, rows: &MotionRows, nominal: &[Vec<f64>], left: &[f64]| {
        let torque: Vec<f64> = rows.tau.iter().map(|tau| rms(tau)).collect();
        let by_nominal = left_by_nominal(robot, rows, nominal);
        let noisy: Vec<f64> =
            by_nominal.iter().zip(&torque).zip(left).map(|((by, torque), left)| by.hypot(left * torque)).collect();
        score(&noisy, &torque)
    };
    // The motion is the same for all robots.
    let under = |mistakes: Vec<Mistake>| {
        let (robot, rows) = without_mistakes(&mistakes, robot, rows);
        nominal_torque(&robot, &rows).map(|nominal| (mistakes, robot, nominal))
    };
    let tried: Vec<_> = with_other_numbers(&best.mistakes).into_iter().filter_map(under).collect();
    let gain = |torque: Vec<Vec<f64>>| {
        let of_likely = MotionRows { tau: torque, ..rows.clone() };
        let as_written = of(robot, &of_likely, &nominal, &as_written.left);
        let gain = |(mistakes, of_best, nominal): &(Vec<Mistake>, ParametricModel, Vec<Vec<f64>>)| {
            let (_, corrected) = without_mistakes(mistakes, robot, &of_likely);
            as_written - of(of_best, &corrected, nominal, &best.left)
        };
        tried.iter().map(gain).fold(f64::NEG_INFINITY, f64::max)
    };
    by_bodies >= torques.map(gain).fold(0.0, f64::max) + CLEARLY_BETTER
}

/// The same mistakes with the numbers of the last one that may be found of other robots.
fn with_other_numbers(mistakes: &[Mistake]) -> Vec<Vec<Mistake>> {
    let Some((last, before)) = mistakes.split_last() else { return vec![Vec::new()] };
    let others = last.facts().other_numbers;
    if others.is_empty() {
        return vec![mistakes.to_vec()];
    }
    others.into_iter().map(|number| [before, &[last.with_number(number)]].concat()).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
