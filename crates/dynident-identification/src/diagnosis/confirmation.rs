//! Confirmation of a hypothesis about a mistake. Three other causes can look like a mistake: another width of the
//! smoothed sign of dry friction, usual errors of the robot description, and placeholder bodies in the description,
//! which another sample rate can compensate.

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

/// Replaces the result of a search by the study as `written`, with refitted widths of the smoothed friction sign, in
/// two cases: the hypothesis of the search is not confirmed, or the search found no hypothesis and the refitted widths
/// differ from those of the study. `None` if the result of the search remains. `believed` is the study of the search's
/// best hypothesis.
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

/// Whether the hypothesis `best` is clearly better than the study as written if both have refitted friction widths.
/// With placeholder bodies, a wrong sample rate can also improve the agreement with the description; for another rate,
/// the consistent fit itself must therefore improve.
fn is_clear(as_written: &Hypothesis, best: &Hypothesis) -> bool {
    let (gain, limits) = (as_written.score() - best.score(), &best.settings.score);
    if best.mistakes.iter().all(|mistake| mistake.facts().is_other_rate) {
        gain >= limits.min_gain_of_rate
            && as_written.consistent_score() - best.consistent_score() >= limits.max_indistinguishable
    } else {
        gain >= limits.min_gain
    }
}

/// Whether the improvement by a hypothesis is clearly larger than the improvement that it would reach by chance. This
/// matters if the improvement comes only from the agreement with the nominal bodies. By chance means: for random robots
/// that differ from the description by usual errors and move as in the study as `written`, without any mistake.
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
    // The motion is the same for all random robots.
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

/// The same list of mistakes, once for each number of the last mistake that a search could find for another robot.
fn with_other_numbers(mistakes: &[Mistake]) -> Vec<Vec<Mistake>> {
    let Some((last, before)) = mistakes.split_last() else { return vec![Vec::new()] };
    let others = last.facts().other_numbers;
    if others.is_empty() {
        return vec![mistakes.to_vec()];
    }
    others.into_iter().map(|number| [before, &[last.with_number(number)]].concat()).collect()
}
