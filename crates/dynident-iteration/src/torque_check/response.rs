//! Checks whether the motion agrees with the torque. A log that contains the commanded torque does not show that
//! drives deliver another torque. And a robot that runs away is stopped before the log is long enough for a fit.
//!
//! * Exchanged joints and a reversed sign are detected within tenths of a second. In the log, the torque of joint i
//!   is the command of joint j, the command of joint i with the opposite sign, or the command of joint i up to a limit.
//!   If the log contains the commanded torque, the motion is used: the acceleration of joint i follows the torque of
//!   joint j without gravity, or decreases while the joint's own torque increases. Constants are free, so wrong masses
//!   have no effect.
//! * Saturation: a model with limited torque, `clamp(τ_j, ±L) = W_j θ_j + friction`, fits the rows of joint j much
//!   better than the logged torque. θ_j is free, so no robot description is needed.

use super::command::LoggedMotion;
use super::explanation::{JointData, friction_columns};
use super::separable_fit::{centred, coefficients, dot, residual_of, rms, square};
use super::{CheckedRun, TorqueCause};
use crate::setup::leg::IterationTask;
use dynident_dynamics::{Workspace, gravity_torque, torque_regressor};

/// Cut-off frequency of the smoothed motion of a run that ended early, as a share of the sampling rate, and minimum
/// number of samples for smoothing.
const SMOOTHING_SHARE: f64 = 0.2;
const MIN_SMOOTHED_SAMPLES: usize = 30;
/// Time before the stop that is compared, s; before that the robot still followed its trajectory.
const BEFORE_STOP_S: f64 = 1.0;
const MIN_SAMPLES: usize = 5;
/// Tested delays of positions and velocities in the controller, s; a filter makes velocities later than positions.
const DELAYS_S: [[f64; 2]; 8] = [
    [0.0, 0.0],
    [0.0, 0.002],
    [0.002, 0.002],
    [0.002, 0.005],
    [0.005, 0.005],
    [0.005, 0.01],
    [0.01, 0.01],
    [0.01, 0.015],
];
/// Largest relative squared difference of torques that are treated as equal, and smallest of torques that are treated
/// as different.
const MAX_EQUAL_DIFFERENCE: f64 = 0.1;
const MIN_OTHER_DIFFERENCE: f64 = 0.5;
/// Largest accepted ratio of the residuals of the best and the second-best explanation.
const MAX_BEST_RESIDUAL_RATIO: f64 = 0.25;
/// Thresholds for the correlation between torque and acceleration: minimum magnitude of the negative correlation of a
/// joint that moves against its torque, minimum correlation of a joint that follows a torque, and maximum correlation
/// with its own torque of a joint that follows another torque.
const MIN_OPPOSITE_CORRELATION: f64 = 0.7;
const MIN_FOLLOWING_CORRELATION: f64 = 0.9;
const MAX_UNRELATED_CORRELATION: f64 = 0.3;
/// A joint runs away if the ratio of its mean velocity to its mean speed is at least this. In an oscillation, the
/// torque of a delayed drive also opposes the acceleration.
const MIN_ONE_WAY_RATIO: f64 = 0.8;
/// Smallest speed relative to the fastest joint; slower joints may be moved by other joints.
const MIN_SPEED_RATIO: f64 = 0.5;

/// Tested limits of a logged torque as shares of its largest value, which noise increases beyond the limit.
const LOG_LIMIT_SHARES: [f64; 5] = [0.92, 0.94, 0.96, 0.98, 1.0];
/// Smallest ratio of a command to the limit that it exceeds.
const MIN_EXCESS_RATIO: f64 = 1.05;
/// Largest relative squared residual of a limited command.
const MAX_LIMITED_RESIDUAL: f64 = 0.02;
/// Tested limits in a motion as shares of the largest logged torque.
const LIMIT_SHARES: core::ops::Range<usize> = 4..40;
const ALL_SHARES: f64 = 40.0;
/// Minimum share of the squared relative residual that a limit must explain.
const MIN_EXPLAINED_SHARE: f64 = 0.65;
/// Minimum relative residual without a limit for which a limit is fitted.
const MIN_RELATIVE_RESIDUAL: f64 = 0.01;
const MIN_ROWS_PER_UNKNOWN: usize = 3;
/// Minimum number of rows at the limit, and maximum share of rows at the limit.
const MIN_ROWS_AT_LIMIT: usize = 4;
const MAX_SHARE_AT_LIMIT: f64 = 0.5;

pub(super) fn early_causes(task: &IterationTask, run: &CheckedRun<'_>) -> Vec<TorqueCause> {
    let Some((leg, record)) = run.legs.iter().zip(run.records).rfind(|(_, record)| record.samples >= MIN_SAMPLES)
    else {
        return Vec::new();
    };
    let smoothing_hz = (record.samples >= MIN_SMOOTHED_SAMPLES).then_some(SMOOTHING_SHARE * record.rate_hz);
    let Some(observed) = LoggedMotion::new(leg, record, smoothing_hz) else { return Vec::new() };
    let first = record.samples.saturating_sub((BEFORE_STOP_S * record.rate_hz).ceil() as usize);
    let rows =
        |all: &[f64]| -> Vec<Vec<f64>> { all.chunks_exact(record.samples).map(|own| own[first..].to_vec()).collect() };
    let logged = rows(&record.tau);
    let commanded = DELAYS_S.iter().filter_map(|&[position_s, velocity_s]| {
        let commanded = observed.commanded(run.controller, run.model, &[position_s, velocity_s, 0.0, 0.0, 0.0])?;
        let commanded = rows(&commanded);
        Some((by_command(&logged, &commanded), commanded))
    });
    // The delays with the fewest undetermined joints are used; light joints have little torque beyond noise.
    let is_open = |own: &Assignment| *own == Assignment::Open;
    let open = |found: &[Assignment]| found.iter().filter(|own| is_open(own)).count();
    let Some((found, commanded)) = commanded.min_by_key(|(found, _)| open(found)) else { return Vec::new() };
    let exchanged = named(task, &found, false);
    let in_log = if exchanged.is_empty() { limits_in_log(task, &logged, &commanded) } else { exchanged };
    if !in_log.is_empty() {
        return in_log;
    }
    let weight = rows(&gravity_along(task, &observed));
    let less_gravity =
        logged.iter().zip(&weight).map(|(tau, weight)| tau.iter().zip(weight).map(|(a, b)| a - b).collect());
    let by_motion = by_motion(&[rows(&observed.dq), rows(&observed.ddq)], &less_gravity.collect::<Vec<_>>());
    let is_commanded =
        |(in_log, moved): (&Assignment, &Assignment)| if is_open(in_log) { Assignment::Open } else { *moved };
    let moved: Vec<Assignment> = found.iter().zip(&by_motion).map(is_commanded).collect();
    named(task, &moved, true)
}

fn limits_in_log(task: &IterationTask, logged: &[Vec<f64>], commanded: &[Vec<f64>]) -> Vec<TorqueCause> {
    let of_joint = |joint: usize| {
        let (y, u) = (&logged[joint], &commanded[joint]);
        let highest = y.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let left = |limit: f64| y.iter().zip(u).map(|(y, u)| (y - u.clamp(-limit, limit)).powi(2)).sum::<f64>();
        let limits = LOG_LIMIT_SHARES.map(|share| share * highest).into_iter();
        let (torque, least) = limits.map(|limit| (limit, left(limit))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let beyond = u.iter().filter(|u| u.abs() > MIN_EXCESS_RATIO * torque).count();
        let explains =
            least < MAX_LIMITED_RESIDUAL * square(y) && least < MAX_BEST_RESIDUAL_RATIO * left(f64::INFINITY);
        let is_limited = beyond >= MIN_ROWS_AT_LIMIT && explains;
        let joint = task.robot.joint_names()[joint].clone();
        is_limited.then_some(TorqueCause::Clipped { joint, torque, is_commanded: false })
    };
    (0..logged.len()).filter_map(of_joint).collect()
}

/// The torque that a joint has in the log, or that it follows in the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Assignment {
    Own,
    Reversed,
    Other(usize),
    Open,
}

/// The commanded torque that each joint has in the log. Joints can only be exchanged in pairs.
fn by_command(logged: &[Vec<f64>], commanded: &[Vec<f64>]) -> Vec<Assignment> {
    let joints = logged.len();
    let share = |to: usize, from: usize, sign: f64| {
        let apart: Vec<f64> = logged[to].iter().zip(&commanded[from]).map(|(a, b)| a - sign * b).collect();
        square(&apart) / square(&logged[to]).max(f64::MIN_POSITIVE)
    };
    let is_other = |joint: usize| share(joint, joint, 1.0) > MIN_OTHER_DIFFERENCE;
    let of_joint = |joint: usize| {
        if !is_other(joint) {
            return Assignment::Own;
        }
        let pair = |other: usize| share(joint, other, 1.0).max(share(other, joint, 1.0));
        let pairs = (0..joints).filter(|&other| other != joint && is_other(other));
        let mut found: Vec<(f64, Assignment)> = pairs.map(|other| (pair(other), Assignment::Other(other))).collect();
        found.push((share(joint, joint, -1.0), Assignment::Reversed));
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_clear = found[0].0 < MAX_EQUAL_DIFFERENCE
            && found.get(1).is_none_or(|next| found[0].0 < MAX_BEST_RESIDUAL_RATIO * next.0);
        if is_clear { found[0].1 } else { Assignment::Open }
    };
    (0..joints).map(of_joint).collect()
}

/// The torque that each joint's acceleration follows.
fn by_motion(motions: &[Vec<Vec<f64>>; 2], torques: &[Vec<f64>]) -> Vec<Assignment> {
    let [velocities, accelerations] = motions;
    let joints = torques.len();
    let speed = |joint: usize| velocities[joint].iter().map(|dq| dq.abs()).sum::<f64>();
    let fastest = (0..joints).map(speed).fold(0.0, f64::max);
    let runs_away = |joint: usize| {
        let is_one_way = velocities[joint].iter().sum::<f64>().abs() >= MIN_ONE_WAY_RATIO * speed(joint);
        is_one_way && speed(joint) >= MIN_SPEED_RATIO * fastest
    };
    let follows = |to: usize, from: usize| {
        let (a, b) = (centred(&accelerations[to]), centred(&torques[from]));
        dot(&a, &b) / (square(&a) * square(&b)).sqrt().max(f64::MIN_POSITIVE)
    };
    let is_pair = |a: usize, b: usize| {
        [a, b].iter().all(|&joint| follows(joint, joint) < MAX_UNRELATED_CORRELATION && runs_away(joint))
            && follows(a, b).min(follows(b, a)) > MIN_FOLLOWING_CORRELATION
    };
    let of_joint = |joint: usize| {
        if follows(joint, joint) < -MIN_OPPOSITE_CORRELATION && runs_away(joint) {
            return Assignment::Reversed;
        }
        let partner = (0..joints).find(|&other| other != joint && is_pair(joint, other));
        partner.map_or(Assignment::Own, Assignment::Other)
    };
    (0..joints).map(of_joint).collect()
}

fn named(task: &IterationTask, found: &[Assignment], is_commanded: bool) -> Vec<TorqueCause> {
    let names = task.robot.joint_names();
    let reversed = (0..found.len()).filter(|&joint| found[joint] == Assignment::Reversed);
    let reversed: Vec<String> = reversed.map(|joint| names[joint].clone()).collect();
    let sign = (!reversed.is_empty()).then_some(TorqueCause::Sign { joints: reversed, is_commanded });
    let exchanged = found.iter().enumerate().filter_map(|(joint, own)| match own {
        Assignment::Other(of) => {
            Some(TorqueCause::Exchanged { joint: names[joint].clone(), of: names[*of].clone(), is_commanded })
        }
        _ => None,
    });
    sign.into_iter().chain(exchanged).collect()
}

/// The gravity torque of the robot description along the motion, joint-major, Nm (N).
fn gravity_along(task: &IterationTask, observed: &LoggedMotion<'_>) -> Vec<f64> {
    let model = task.robot.model();
    let mut workspace = Workspace::new(model);
    let joints = model.dof();
    let samples = observed.q.len() / joints;
    let mut out = vec![0.0; joints * samples];
    for sample in 0..samples {
        let q: Vec<f64> = (0..joints).map(|joint| observed.q[joint * samples + sample]).collect();
        let weight = gravity_torque(model, &mut workspace, &q);
        (0..joints).for_each(|joint| out[joint * samples + sample] = weight[joint]);
    }
    out
}

/// Joints whose drives are saturated although the log contains a larger torque.
pub(super) fn limit_causes(data: &JointData<'_>) -> Vec<TorqueCause> {
    let names = data.task.robot.joint_names();
    let of_joint = |joint: usize| {
        let torque = limit_in_motion(data, joint)?;
        Some(TorqueCause::Clipped { joint: names[joint].clone(), torque, is_commanded: true })
    };
    (0..data.torque.len()).filter_map(of_joint).collect()
}

/// Torque limit of a joint from its motion, Nm (N), if the log contains a larger torque; `None` if no limit explains
/// the motion clearly better.
fn limit_in_motion(data: &JointData<'_>, joint: usize) -> Option<f64> {
    let y = &data.torque[joint];
    let columns: Vec<Vec<f64>> = model_columns(data, joint).into_iter().chain(friction_columns(data, joint)).collect();
    if y.len() < MIN_ROWS_PER_UNKNOWN * (columns.len() + 1) {
        return None;
    }
    let highest = y.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let left_at = |limit: f64| {
        let delivered: Vec<f64> = y.iter().map(|y| y.clamp(-limit, limit)).collect();
        let left = square(&residual_of(&columns, &delivered, &coefficients(&columns, &delivered)));
        left / square(&centred(&delivered)).max(f64::MIN_POSITIVE)
    };
    let as_logged = left_at(highest);
    if as_logged <= MIN_RELATIVE_RESIDUAL.powi(2) {
        return None;
    }
    let at_limit = |limit: f64| y.iter().filter(|y| y.abs() > limit).count();
    let is_possible = |limit: &f64| {
        (MIN_ROWS_AT_LIMIT as f64..=MAX_SHARE_AT_LIMIT * y.len() as f64).contains(&(at_limit(*limit) as f64))
    };
    let limits = LIMIT_SHARES.map(|share| highest * share as f64 / ALL_SHARES).filter(is_possible);
    let (limit, left) = limits.map(|limit| (limit, left_at(limit))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    (left < (1.0 - MIN_EXPLAINED_SHARE) * as_logged).then_some(limit)
}

/// The columns of the joint's torque for the inertial parameters of all bodies.
fn model_columns(data: &JointData<'_>, joint: usize) -> Vec<Vec<f64>> {
    let model = data.task.robot.model();
    let (dof, count) = (model.dof(), model.inertial_count());
    let mut workspace = Workspace::new(model);
    let rows = data.torque[joint].len();
    let mut columns = vec![vec![0.0; rows]; count];
    let [mut q, mut dq, mut ddq] = [(); 3].map(|()| vec![0.0; dof]);
    for row in 0..rows {
        for (to, from) in [(&mut q, data.q), (&mut dq, data.dq), (&mut ddq, data.ddq)] {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = from[row]);
        }
        let y = torque_regressor(model, &mut workspace, &q, &dq, &ddq);
        columns.iter_mut().enumerate().for_each(|(column, to)| to[row] = y[joint * count + column]);
    }
    columns.retain(|column| rms(column) > 1e-9);
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(of: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..12).map(|k| of(f64::from(k) / 12.0)).collect()
    }

    #[test]
    fn exchanged_and_reversed_torques_are_found_in_a_dozen_samples() {
        let commanded = [series(|t| 3.0 * t + 1.0), series(|t| 5.0 * t * t - 2.0), series(|t| 0.3 - t)];
        let [a, b, c] = commanded.clone();
        let own = Assignment::Own;
        assert_eq!(by_command(&commanded, &commanded), [own; 3]);
        let found = by_command(&[b.clone(), a.clone(), c.clone()], &commanded);
        assert_eq!(found, [Assignment::Other(1), Assignment::Other(0), own]);
        let reversed = c.iter().map(|tau| -tau).collect();
        assert_eq!(by_command(&[a.clone(), b.clone(), reversed], &commanded), [own, own, Assignment::Reversed]);
        // A torque that no joint commanded.
        let other = series(|t| (9.0 * t).sin());
        assert_eq!(by_command(&[other, b, c], &commanded), [Assignment::Open, own, own]);
    }

    #[test]
    fn a_joint_that_runs_away_against_its_torque_is_found() {
        let grows = series(|t| (3.0 * t).exp());
        let falls: Vec<f64> = grows.iter().map(|value| 4.0 - 2.0 * value).collect();
        let still = series(|t| 0.1 * (20.0 * t).sin());
        let motion = |joint: &[f64]| [vec![joint.to_vec(), still.clone()], vec![joint.to_vec(), still.clone()]];
        let own = Assignment::Own;
        assert_eq!(by_motion(&motion(&grows), &[falls.clone(), still.clone()]), [Assignment::Reversed, own]);
        assert_eq!(by_motion(&motion(&grows), &[grows.clone(), still.clone()]), [own, own]);
        // The torque of a delayed drive in an oscillation.
        let swings = series(|t| (12.0 * t).sin());
        let late = swings.iter().map(|value| -value).collect();
        assert_eq!(by_motion(&motion(&swings), &[late, still.clone()]), [own, own]);
    }

    #[test]
    fn joints_that_run_away_by_each_other_s_torque_are_found() {
        let (first, second) = (series(|t| (4.0 * t).exp()), series(|t| 20.0 - 80.0 * (t - 0.5).powi(2)));
        let motion = [vec![first.clone(), second.clone()], vec![first.clone(), second.clone()]];
        let found = by_motion(&motion, &[second, first]);
        assert_eq!(found, [Assignment::Other(1), Assignment::Other(0)]);
    }
}
