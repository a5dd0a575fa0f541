//! Mistakes of a held-out log alone: a format of its own, another day's cables. The training logs' parameters are
//! known, so that every reading of it is asked for nothing but its residual.

use super::candidates::{Breadth, candidates};
use super::explanation::predicted;
use super::mistake::{Channels, Mistake};
use super::motion_rows::{INSTANTS, MotionRows};
use super::numbers::between_those_tried;
use super::plausibility::beyond_limits;
use super::reading::{ALIKE, CLEARLY_BETTER};
use super::torque_clock::TorqueClock;
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
/// A gain of a torque that differs from one by less is a drive's own.
const LEAST_GAIN: f64 = 1.15;
/// Zeros beside those that studies have wrong: with the parameters known small ones tell as well.
const ZEROS_RAD: [f64; 6] = [-0.3, -0.15, -0.07, 0.07, 0.15, 0.3];

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
/// `clock` has its torque at other moments, where it is long enough.
pub(super) fn held_out_reading(
    robot: &ParametricModel,
    (rows, clock): (&MotionRows, Option<&TorqueClock<'_>>),
    log: usize,
    (theta, trained): (&[f64], &[f64]),
) -> Option<HeldOutReading> {
    let as_written = residual(robot, rows, theta, trained);
    let is_explained = |(left, explained): (&f64, &f64)| *left < NOT_EXPLAINED * explained;
    if as_written.left.iter().zip(&as_written.explained).all(is_explained) {
        return None;
    }
    // All logs are of one robot at one place.
    let is_of_log = |mistake: &Mistake| {
        !matches!(
            mistake,
            Mistake::Gravity { .. } | Mistake::Convention { .. } | Mistake::Length { .. } | Mistake::Compensated
        )
    };
    let mut all: Vec<Mistake> = candidates(robot, rows, Breadth::All).into_iter().filter(is_of_log).collect();
    all.extend(gains(robot, rows, theta));
    let turning = (0..robot.dof()).filter(|&joint| robot.model().joints()[joint].turns());
    all.extend(turning.flat_map(|joint| ZEROS_RAD.map(|offset_rad| Mistake::Offset { joint, offset_rad })));
    let read = |mistake: &Mistake| residual(robot, &mistake.corrected(robot, rows), theta, trained);
    let mut readings: Vec<(Mistake, f64)> =
        all.par_iter().map(|mistake| (mistake.clone(), read(mistake).score + mistake.rarity())).collect();
    readings.sort_by(|a, b| a.1.total_cmp(&b.1));
    let least = readings.first().map_or(f64::INFINITY, |first| first.1);
    let late = clock.and_then(|clock| late_reading((robot, clock), theta, trained));
    if let Some((mistake, without)) = late {
        let score = without.score + mistake.rarity();
        if score < least && explains((score, &without), &as_written) {
            let alike = readings.iter().filter(|other| other.1 < score + ALIKE).map(|other| other.0.clone()).collect();
            let (left_as_written, left_without) = (as_written.rms, without.rms);
            return Some(HeldOutReading { log, mistake, alike, left_as_written, left_without });
        }
    }
    let (first, score) = readings.first()?.clone();
    let without = read(&first);
    if !explains((score, &without), &as_written) {
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

/// The log with the torque of all joints at the moment that the parameters explain best; none where that is a lag that
/// a fit takes off by itself.
fn late_reading(
    (robot, clock): (&ParametricModel, &TorqueClock<'_>),
    theta: &[f64],
    trained: &[f64],
) -> Option<(Mistake, Residual)> {
    let joints: Vec<usize> = (0..robot.dof()).collect();
    let channels = (&joints[..], Channels::Torque);
    let read = |lag_s: f64| residual(robot, &clock.rows(channels, lag_s, INSTANTS), theta, trained);
    let tried: Vec<f64> = clock.lags_s().collect();
    let scores: Vec<f64> = tried.par_iter().map(|&lag_s| read(lag_s).score).collect();
    let best = (0..tried.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b]))?;
    let lag_s = clock.least_near(tried[best], |lag_s| read(lag_s).score);
    Some((clock.mistake(channels, lag_s)?, read(lag_s)))
}

/// Whether a reading goes half of the way to what the training logs leave, or explains every joint that was not: else
/// it is something else.
fn explains((score, reading): (f64, &Residual), as_written: &Residual) -> bool {
    let explained: f64 = as_written.explained.iter().map(|left| left.ln()).sum();
    let is_explained =
        |residual: &Residual, joint: usize| residual.left[joint] < NOT_EXPLAINED * residual.explained[joint];
    let all_are = (0..reading.left.len()).all(|joint| is_explained(reading, joint));
    (score < 0.5 * (as_written.score + explained) || all_are)
        && score <= as_written.score - CLEARLY_BETTER
        && reading.rms < as_written.rms
}

/// The gain of each joint's torque that suits the parameters best, where it is not that of a drive.
fn gains(robot: &ParametricModel, rows: &MotionRows, theta: &[f64]) -> Vec<Mistake> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let gain = |(joint, explained): (usize, Vec<f64>)| {
        let factor = dot(&explained, &rows.tau[joint]) / dot(&rows.tau[joint], &rows.tau[joint]);
        let is_clear = factor > 0.0 && factor.ln().abs() > LEAST_GAIN.ln();
        is_clear.then_some(Mistake::TorqueUnit { joint, factor })
    };
    predicted(robot, rows, theta).into_iter().enumerate().filter_map(gain).collect()
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
