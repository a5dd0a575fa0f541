//! A mistake that was found is looked at once more, for three things that are none look like one: another step of dry
//! friction, a description with usual errors, and bodies of placeholders, which another rate makes up for.

use super::error::DiagnosisError;
use super::joint_fits::score;
use super::mistake::{Mistake, without_mistakes};
use super::motion_rows::MotionRows;
use super::nominal::{left_by_nominal, nominal_torque};
use super::reading::{ALIKE, CLEARLY_BETTER, Corrected, NOMINAL_WEIGHT, Reading};
use super::search::Search;
use super::step_width::with_steps_of;
use super::usual_errors::torques_of_likely_robots;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;

/// By how much another rate has to be better: those of honest logs gain 1.1, of logs with another rate 2.0 and more.
const CLEARLY_ANOTHER_RATE: f64 = 2.0 * CLEARLY_BETTER;
/// Times an offset that was found that other robots are asked for.
const OTHER_OFFSETS: [f64; 6] = [-1.0, -0.5, -0.25, 0.25, 0.5, 1.0];

/// The study as written with the steps of dry friction that the rows ask for, where the mistake of `search` is not
/// confirmed, or there is none and these steps are others than the study's; none where the search stands as it is.
/// `rows` are those of the study as written, `corrected` robot and rows of the search's best reading.
///
/// # Errors
/// Too few rows.
pub(super) fn without_mistake(
    (robot, rows): (&ParametricModel, &MotionRows),
    corrected: (&ParametricModel, &MotionRows),
    search: &Search,
    consistency: &ConsistencySettings,
) -> Result<Option<(ParametricModel, Reading)>, DiagnosisError> {
    let own_steps = with_steps_of(robot, rows)?;
    if search.best.is_none() && own_steps.terms() == robot.terms() {
        return Ok(None);
    }
    let as_written = Corrected::new(own_steps.clone(), rows.clone(), Vec::new()).reading(Some(consistency))?;
    let Some(best) = &search.best else { return Ok(Some((own_steps, as_written))) };
    let corrected = Corrected {
        torque_growth: best.torque_growth,
        ..Corrected::new(with_steps_of(corrected.0, corrected.1)?, corrected.1.clone(), best.mistakes.clone())
    };
    let best = corrected.reading(Some(consistency))?;
    let is_confirmed = is_clear(&as_written, &best) && is_beyond_usual_errors((robot, rows), [&as_written, &best]);
    Ok((!is_confirmed).then_some((own_steps, as_written)))
}

/// Whether a reading is better where each has its own steps. What the description's bodies say of a rate, placeholders
/// say as well: it must be seen in what a robot can be.
fn is_clear(as_written: &Reading, best: &Reading) -> bool {
    let gain = as_written.score() - best.score();
    if best.mistakes.iter().all(Mistake::is_other_rate) {
        gain >= CLEARLY_ANOTHER_RATE && as_written.consistent_score - best.consistent_score >= ALIKE
    } else {
        gain >= CLEARLY_BETTER
    }
}

/// Whether a reading that is better by the description's bodies alone is so by clearly more than with any of the robots
/// that are described with usual errors, moved as in these rows and without any mistake.
fn is_beyond_usual_errors((robot, rows): (&ParametricModel, &MotionRows), [as_written, best]: [&Reading; 2]) -> bool {
    let by_bodies = as_written.nominal_score - best.nominal_score;
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

/// The same mistakes as they may be found of other robots: what the last one has for a number was chosen to gain most.
fn with_other_numbers(mistakes: &[Mistake]) -> Vec<Vec<Mistake>> {
    let Some((&Mistake::Offset { joint, offset_rad }, before)) = mistakes.split_last() else {
        return vec![mistakes.to_vec()];
    };
    let with = |times: f64| [before, &[Mistake::Offset { joint, offset_rad: times * offset_rad }]].concat();
    OTHER_OFFSETS.map(with).to_vec()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
