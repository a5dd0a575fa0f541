//! What explains that the logged torque of a joint is not the commanded one.
//!
//! Each candidate is a correction of the commanded torque `u` with few unknowns, and a constant is free in all of them.
//! A candidate explains the share `1 − RSS_c / RSS_0` of the difference's square. One is named only if it explains
//! nearly all, and clearly more than every other.

use super::TorqueCheckSettings;
use super::separable_fit::{JointColumns, centred, coefficients, dot, residual_of, rms, square};
use crate::leg::IterationTask;
use dynident_dynamics::{Workspace, gravity_torque, torque_regressor};
use serde::{Deserialize, Serialize};

/// Share of the squared difference that a named candidate explains at least.
const LEAST_EXPLAINED: f64 = 0.85;
/// What the runner-up leaves of the squared difference, at least, in units of what the named candidate leaves.
const CLEARLY_BETTER: f64 = 2.0;
/// Time blocks of the jackknife of a scale.
const BLOCKS: usize = 10;
/// Widths of the steps of friction that are tried, as shares of the joint's highest speed.
const STEP_WIDTHS: [f64; 3] = [0.02, 0.08, 0.3];
/// Limits of torque that are tried, as shares of the largest commanded torque.
const CLIP_SHARES: usize = 40;

/// A candidate, without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TorqueCandidate {
    /// Another scale, positive.
    Scale,
    /// A reversed sign.
    Sign,
    /// The torque of another joint.
    Exchanged,
    /// Gravity is missing.
    Gravity,
    /// Friction is missing.
    Friction,
    /// The torque is limited.
    Clipped,
}

/// A candidate with its numbers for one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fitted {
    pub(super) candidate: TorqueCandidate,
    /// Scale, limit of the torque (Nm, N), or number of the other joint.
    pub(super) value: f64,
    /// Share of the squared difference that it explains.
    pub(super) explained: f64,
}

/// What the comparison shows of one joint.
#[derive(Clone, Debug)]
pub(super) struct Explanation {
    pub(super) scale: Option<f64>,
    pub(super) scale_std: Option<f64>,
    pub(super) difference_percent: f64,
    /// The commanded torque, with its constant.
    pub(super) commanded: Vec<f64>,
    /// Whether the difference matters.
    pub(super) matters: bool,
    /// All candidates, the best first; empty where the difference does not matter.
    pub(super) candidates: Vec<Fitted>,
}

impl Explanation {
    /// The candidate that is named.
    pub(super) fn named(&self) -> Option<Fitted> {
        let best = *self.candidates.first().filter(|best| best.explained >= LEAST_EXPLAINED)?;
        let left = |of: &Fitted| 1.0 - of.explained;
        let is_clear = self.candidates[1..].iter().all(|other| left(other) >= CLEARLY_BETTER * left(&best));
        is_clear.then_some(best)
    }
}

/// The torques and motions of all joints, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct JointData<'a> {
    pub(super) task: &'a IterationTask,
    pub(super) torque: &'a [Vec<f64>],
    /// The first column is the commanded torque, or what is fed forward; further ones are the drives' own loop.
    pub(super) columns: &'a [JointColumns],
    pub(super) q: &'a [Vec<f64>],
    pub(super) dq: &'a [Vec<f64>],
}

/// Compares one joint, and finds what explains a difference.
pub(super) fn explain(data: &JointData<'_>, joint: usize, settings: &TorqueCheckSettings) -> Explanation {
    let (y, columns) = (&data.torque[joint], &data.columns[joint]);
    let size = rms(y).max(f64::MIN_POSITIVE);
    let free = coefficients(columns, y);
    let std = jackknife(columns, y);
    // As it should be: the scale one, the drives' own loop as it fits.
    let (first, own_loop) = columns.split_first().map_or((&[][..], &[][..]), |(first, rest)| (&first[..], rest));
    let beside: Vec<f64> = y.iter().zip(first).map(|(y, u)| y - u).collect();
    let of_loop = coefficients(own_loop, &beside);
    let difference = residual_of(own_loop, &beside, &of_loop);
    let commanded: Vec<f64> = y.iter().zip(&difference).map(|(y, r)| y - r).collect();
    let difference_percent = 100.0 * rms(&difference) / size;
    let scale = free[0];
    let off = 100.0 * (scale - 1.0).abs();
    let is_scaled = off > settings.scale_percent && (scale - 1.0).abs() > settings.sigmas * std;
    let matters = is_scaled || difference_percent > settings.difference_percent;
    let mut out = Explanation {
        scale: std.is_finite().then_some(scale),
        scale_std: std.is_finite().then_some(std),
        difference_percent,
        commanded,
        matters,
        candidates: Vec::new(),
    };
    if !matters {
        return out;
    }
    let total = square(&difference).max(f64::MIN_POSITIVE);
    let explained = |left: &[f64]| 1.0 - square(left) / total;
    let add = |candidate, value, explained| Fitted { candidate, value, explained };
    let with_loop = |extra: Vec<Vec<f64>>, from: &[f64]| {
        let all: Vec<Vec<f64>> = extra.into_iter().chain(own_loop.iter().cloned()).collect();
        let found = coefficients(&all, from);
        let left = residual_of(&all, from, &found);
        (found, left)
    };
    let mut candidates = Vec::new();
    // Another scale, or sign.
    let left = residual_of(columns, y, &free);
    let of_scale = if scale < 0.0 { TorqueCandidate::Sign } else { TorqueCandidate::Scale };
    candidates.push(add(of_scale, scale, explained(&left)));
    // Another joint's torque.
    for other in (0..data.torque.len()).filter(|&other| other != joint) {
        let Some(theirs) = data.columns[other].first() else { continue };
        let own: Vec<Vec<f64>> = data.columns[other][1..].to_vec();
        let beside: Vec<f64> = y.iter().zip(theirs).map(|(y, u)| y - u).collect();
        let left = residual_of(&own, &beside, &coefficients(&own, &beside));
        candidates.push(add(TorqueCandidate::Exchanged, other as f64, explained(&left)));
    }
    // Gravity is missing.
    if let Some(gravity) = gravity_columns(data, joint) {
        let (found, left) = with_loop(gravity.clone(), &beside);
        let missing: Vec<f64> = (0..y.len())
            .map(|row| -gravity.iter().zip(&found).map(|(column, value)| column[row] * value).sum::<f64>())
            .collect();
        if is_of_nominal_size(data, joint, &missing) {
            candidates.push(add(TorqueCandidate::Gravity, 1.0, explained(&left)));
        }
    }
    // Friction is missing: what is missing takes energy out.
    let fastest = data.dq[joint].iter().fold(0.0_f64, |most, dq| most.max(dq.abs()));
    if fastest > 0.0 {
        let steps = STEP_WIDTHS.map(|width| data.dq[joint].iter().map(|dq| (dq / (width * fastest)).tanh()).collect());
        let friction: Vec<Vec<f64>> = core::iter::once(data.dq[joint].clone()).chain(steps).collect();
        let (found, left) = with_loop(friction.clone(), &beside);
        let power: f64 = friction.iter().zip(&found).map(|(column, value)| value * dot(column, &data.dq[joint])).sum();
        if power < 0.0 {
            candidates.push(add(TorqueCandidate::Friction, 1.0, explained(&left)));
        }
    }
    if own_loop.is_empty() {
        candidates.extend(clipped(y, first, total));
    }
    candidates.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    // Another joint that is explained alike is no rival of the nearest one.
    let mut kept: Vec<Fitted> = Vec::new();
    for one in candidates {
        if !kept.iter().any(|other| other.candidate == one.candidate) {
            kept.push(one);
        }
    }
    out.candidates = kept;
    out
}

/// A limit of the torque.
fn clipped(y: &[f64], commanded: &[f64], total: f64) -> Option<Fitted> {
    let most = commanded.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    let at = |share: usize| {
        let limit = most * share as f64 / CLIP_SHARES as f64;
        let left = centred(&y.iter().zip(commanded).map(|(y, u)| y - u.clamp(-limit, limit)).collect::<Vec<_>>());
        Fitted { candidate: TorqueCandidate::Clipped, value: limit, explained: 1.0 - square(&left) / total }
    };
    (1..CLIP_SHARES).map(at).max_by(|a, b| a.explained.total_cmp(&b.explained))
}

/// The columns of the joint's gravity torque for the mass and the first moments of each body.
fn gravity_columns(data: &JointData<'_>, joint: usize) -> Option<Vec<Vec<f64>>> {
    let model = data.task.robot.model();
    let (dof, count) = (model.dof(), model.inertial_count());
    let mut workspace = Workspace::new(model);
    let (mut q, rest) = (vec![0.0; dof], vec![0.0; dof]);
    let rows = data.torque[joint].len();
    let used: Vec<usize> = (0..count).filter(|column| column % 10 < 4).collect();
    let mut columns = vec![vec![0.0; rows]; used.len()];
    for row in 0..rows {
        q.iter_mut().zip(data.q).for_each(|(to, from)| *to = from[row]);
        let y = torque_regressor(model, &mut workspace, &q, &rest, &rest);
        columns.iter_mut().zip(&used).for_each(|(to, &column)| to[row] = y[joint * count + column]);
    }
    columns.retain(|column| rms(&centred(column)) > 1e-9);
    (!columns.is_empty()).then_some(columns)
}

/// Whether a torque is about the gravity torque of the description: what is missing points the same way and is neither
/// less than half nor more than twice as large. Any size is accepted where the description has no masses.
fn is_of_nominal_size(data: &JointData<'_>, joint: usize, missing: &[f64]) -> bool {
    let robot = &data.task.robot;
    let model = robot.model();
    let mut workspace = Workspace::new(model);
    let mut q = vec![0.0; model.dof()];
    let nominal: Vec<f64> = (0..missing.len())
        .map(|row| {
            q.iter_mut().zip(data.q).for_each(|(to, from)| *to = from[row]);
            gravity_torque(model, &mut workspace, &q)[joint]
        })
        .collect();
    let (nominal, missing) = (centred(&nominal), centred(missing));
    let own = square(&nominal);
    own == 0.0 || (0.5..=2.0).contains(&(dot(&nominal, &missing) / own))
}

/// Standard deviation of the first coefficient, by leaving out one time block after the other; infinite where the rows
/// do not determine it.
fn jackknife(columns: &[Vec<f64>], y: &[f64]) -> f64 {
    let rows = y.len();
    let Some(first) = columns.first() else { return f64::INFINITY };
    if rows < 2 * BLOCKS || rms(&centred(first)) <= 1e-9 * rms(y) {
        return f64::INFINITY;
    }
    let without = |values: &[f64], block: usize| -> Vec<f64> {
        let (from, to) = (block * rows / BLOCKS, (block + 1) * rows / BLOCKS);
        values[..from].iter().chain(&values[to..]).copied().collect()
    };
    let found: Vec<f64> = (0..BLOCKS)
        .map(|block| {
            let columns: Vec<Vec<f64>> = columns.iter().map(|column| without(column, block)).collect();
            coefficients(&columns, &without(y, block))[0]
        })
        .collect();
    let count = BLOCKS as f64;
    let mean = found.iter().sum::<f64>() / count;
    ((count - 1.0) / count * found.iter().map(|value| (value - mean).powi(2)).sum::<f64>()).sqrt()
}
