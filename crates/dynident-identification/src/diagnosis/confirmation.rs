//! Confirmation of a hypothesis against three causes that look like a mistake: another step of dry friction, a
//! description with usual errors, and placeholder bodies, for which another rate compensates.

use super::error::DiagnosisError;
use super::hypothesis::{CorrectedStudy, Hypothesis};
use super::joint_fits::score;
use super::mistakes::Mistake;
use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, nominal_torque};
use super::search::Search;
use super::span::root_mean_square;
use super::usual_errors::torques_of_likely_robots;
use crate::consistent::ConsistencySettings;

/// Replaces the result of a search by the study as `written`, with the friction steps that its rows need, if the
/// hypothesis of the search is not confirmed, or if the search found no hypothesis and these steps differ from the
/// study's. `None` if the search is confirmed. `believed` is the study of the search's best hypothesis.
pub(super) fn unless_confirmed(
    written: &CorrectedStudy,
    believed: &CorrectedStudy,
    search: &Search,
    consistency: &ConsistencySettings,
) -> Result<Option<(CorrectedStudy, Search)>, DiagnosisError> {
    let own_steps = written.with_fitted_steps()?;
    if search.best.is_none() && own_steps.robot.terms() == written.robot.terms() {
        return Ok(None);
    }
    let as_written = own_steps.hypothesis(Some(consistency))?;
    if search.best.is_some() {
        let best = believed.with_fitted_steps()?.hypothesis(Some(consistency))?;
        if is_clear(&as_written, &best) && is_beyond_usual_errors(written, &as_written, &best) {
            return Ok(None);
        }
    }
    Ok(Some((own_steps, Search { as_written, best: None, alike: Vec::new(), tried: search.tried })))
}

/// Whether a hypothesis is better where each has its own steps. Placeholder bodies support another rate as much as
/// described bodies do, so the consistent fit has to improve.
fn is_clear(as_written: &Hypothesis, best: &Hypothesis) -> bool {
    let (gain, limits) = (as_written.score() - best.score(), &best.settings.score);
    if best.mistakes.iter().all(|mistake| mistake.facts().is_other_rate) {
        gain >= limits.min_gain_of_rate
            && as_written.consistent_score() - best.consistent_score() >= limits.max_indistinguishable
    } else {
        gain >= limits.min_gain
    }
}

/// Whether a hypothesis that only the nominal bodies support gains clearly more than with any robot whose description
/// has usual errors, in the motion of the study as `written` and without any mistake.
fn is_beyond_usual_errors(written: &CorrectedStudy, as_written: &Hypothesis, best: &Hypothesis) -> bool {
    let limits = &written.settings.score;
    let by_bodies = as_written.nominal_score() - best.nominal_score();
    if as_written.score() - best.score() - limits.nominal_weight * by_bodies >= limits.min_gain {
        return true;
    }
    let CorrectedStudy { robot, rows, .. } = written;
    let (Some(torques), Some(nominal)) = (torques_of_likely_robots(robot, rows), nominal_torque(robot, rows)) else {
        return true;
    };
    let of = |study: &CorrectedStudy, nominal: &[Vec<f64>], left: &[f64]| {
        let torque: Vec<f64> = study.rows.tau.iter().map(|tau| root_mean_square(tau)).collect();
        let by_nominal = left_by_nominal(&study.robot, &study.rows, nominal);
        let noisy: Vec<f64> =
            by_nominal.iter().zip(&torque).zip(left).map(|((by, torque), left)| by.hypot(left * torque)).collect();
        score(&noisy, &torque)
    };
    // The motion is the same for all robots.
    let under = |mistakes: Vec<Mistake>| {
        let study = written.without_all(&mistakes);
        nominal_torque(&study.robot, &study.rows).map(|nominal| (mistakes, nominal))
    };
    let tried: Vec<_> = with_other_numbers(&best.mistakes).into_iter().filter_map(under).collect();
    let gain = |tau: Vec<Vec<f64>>| {
        let of_likely = CorrectedStudy { rows: MotionRows { tau, ..rows.clone() }, ..written.clone() };
        let as_written = of(&of_likely, &nominal, &as_written.left);
        let gain = |(mistakes, nominal): &(Vec<Mistake>, Vec<Vec<f64>>)| {
            as_written - of(&of_likely.without_all(mistakes), nominal, &best.left)
        };
        tried.iter().map(gain).fold(f64::NEG_INFINITY, f64::max)
    };
    by_bodies >= torques.map(gain).fold(0.0, f64::max) + limits.min_gain
}

/// The same mistakes, the last one with each number that a search could find for another robot.
fn with_other_numbers(mistakes: &[Mistake]) -> Vec<Vec<Mistake>> {
    let Some((last, before)) = mistakes.split_last() else { return vec![Vec::new()] };
    let others = last.facts().other_numbers;
    if others.is_empty() {
        return vec![mistakes.to_vec()];
    }
    others.into_iter().map(|number| [before, &[last.with_number(number)]].concat()).collect()
}
