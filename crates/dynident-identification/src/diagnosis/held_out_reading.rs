//! Mistakes of a held-out log alone: a format of its own, another day's cables. The training logs' parameters are
//! known, so that every reading of it is asked for nothing but its residual.

use super::candidates::{Breadth, candidates};
use super::explanation::predicted;
use super::mistake::Mistake;
use super::motion_rows::MotionRows;
use super::plausibility::beyond_limits;
use super::search::{ALIKE, CLEARLY_BETTER, between_those_tried};
use dynident_dynamics::ParametricModel;
use rayon::prelude::*;

/// Times the share of a joint's torque that the training logs leave, from which on a held-out log is not explained;
/// over all joints together real sets reach 2.4.
const NOT_EXPLAINED: f64 = 3.0;
/// Share of a joint's torque that counts as nothing.
const FLOOR: f64 = 1.0e-2;
/// By how much a number between those tried must be better than the nearest of these.
const WORTH_REFINING: f64 = 0.05;
/// What a joint beyond its limits costs, as in readings of training logs.
const LIMIT_COST: f64 = 1.0;

/// A reading of a held-out log that the training logs' parameters explain, where they do not explain the log as it is.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOutReading {
    /// Number of the recording.
    pub log: usize,
    /// The mistake that the log was read without.
    pub mistake: Mistake,
    /// Others that explain it as well.
    pub alike: Vec<Mistake>,
    /// Root mean square of what is left of the torque as the study reads it, joints stacked, Nm.
    pub left_as_written: f64,
    /// The same without the mistake.
    pub left_without: f64,
}

/// One reading's residuals.
struct Residual {
    /// `Σ_j ln(share of joint j's torque that is left)`, no less than what training logs leave, and limits.
    score: f64,
    /// Root mean square of all joints, Nm.
    rms: f64,
    /// Share of each joint's torque that is left; one of a joint without torque.
    left: Vec<f64>,
    /// What the training logs leave of it, at least what counts as nothing.
    explained: Vec<f64>,
}

/// Looks for one mistake in recording number `log`, whose instants are `rows`, that explains why base parameters
/// `theta` leave clearly more of its torque than the shares `trained` of each joint's torque in the training logs.
pub(super) fn held_out_reading(
    robot: &ParametricModel,
    rows: &MotionRows,
    log: usize,
    (theta, trained): (&[f64], &[f64]),
) -> Option<HeldOutReading> {
    let as_written = residual(robot, rows, theta, trained);
    let explained: f64 = as_written.explained.iter().map(|left| left.ln()).sum();
    let is_explained = |(left, explained): (&f64, &f64)| *left < NOT_EXPLAINED * explained;
    if as_written.left.iter().zip(&as_written.explained).all(is_explained) {
        return None;
    }
    // All logs are of one robot at one place.
    let is_of_log = |mistake: &Mistake| !matches!(mistake, Mistake::Gravity { .. });
    let all: Vec<Mistake> = candidates(robot, rows, Breadth::All).into_iter().filter(is_of_log).collect();
    let read = |mistake: &Mistake| residual(robot, &mistake.corrected(rows), theta, trained);
    let mut readings: Vec<(Mistake, f64)> =
        all.par_iter().map(|mistake| (mistake.clone(), read(mistake).score + mistake.rarity())).collect();
    readings.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (first, score) = readings.first()?.clone();
    // Half of the way to what the training logs leave, at least: else it is something else.
    let without = read(&first);
    let is_better = score < 0.5 * (as_written.score + explained) && without.rms < as_written.rms;
    if !is_better || score > as_written.score - CLEARLY_BETTER {
        return None;
    }
    let alike = readings[1..].iter().filter(|other| other.1 < score + ALIKE).map(|other| other.0.clone()).collect();
    // With the parameters known every number is told to what the noise leaves of it.
    let between = between_those_tried(&first, |mistake| read(mistake).score);
    let (mistake, without) = match between.map(|mistake| (read(&mistake), mistake)) {
        Some((reading, mistake)) if reading.score < without.score - WORTH_REFINING => (mistake, reading),
        _ => (first, without),
    };
    let (left_as_written, left_without) = (as_written.rms, without.rms);
    Some(HeldOutReading { log, mistake, alike, left_as_written, left_without })
}

fn residual(robot: &ParametricModel, rows: &MotionRows, theta: &[f64], trained: &[f64]) -> Residual {
    let explained = predicted(robot, rows, theta);
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let least: Vec<f64> = trained.iter().map(|left| left.max(FLOOR)).collect();
    let (mut shares, mut sum) = (Vec::with_capacity(least.len()), 0.0);
    for ((explained, tau), least) in explained.iter().zip(&rows.tau).zip(&least) {
        let left: Vec<f64> = tau.iter().zip(explained).map(|(tau, explained)| tau - explained).collect();
        let (left, torque) = (squares(&left), squares(tau));
        sum += left;
        shares.push(if torque > 0.0 { (left / torque).sqrt().max(*least) } else { 1.0 });
    }
    let count = (rows.len() * explained.len()).max(1) as f64;
    let broken = beyond_limits(robot.model(), rows).len() as f64;
    let score = shares.iter().map(|left| left.ln()).sum::<f64>() + LIMIT_COST * broken;
    Residual { score, rms: (sum / count).sqrt(), left: shares, explained: least }
}
