//! Candidate causes of a difference between logged and commanded torque of a joint.
//!
//! Each candidate is a correction of the commanded torque with few unknowns and a free constant. With the residual
//! sum of squares RSS_c after the correction and RSS_0 before it, a candidate explains the share `1 − RSS_c / RSS_0`
//! of the squared difference. It is reported only if it explains nearly all, and clearly more than every other
//! candidate.

use super::separable_fit::{JointColumns, centred, coefficients, dot, residual_of, rms, square};
use crate::setup::leg::IterationTask;
use crate::setup::torque_check_settings::TorqueCheckSettings;
use dynident_dynamics::{Workspace, gravity_torque, torque_regressor};
use serde::{Deserialize, Serialize};

/// Number of rows per independent row, because the residuals of neighbouring rows are correlated.
const CORRELATED_ROWS: f64 = 3.0;
/// Minimum number of degrees of freedom of a candidate's fit. If a run contains only a few moves, candidates cannot
/// be distinguished; only saturation is detected earlier.
const MIN_DEGREES_OF_FREEDOM: f64 = 16.0;
/// The sign of the logged torque is probably wrong if at least this share of the torque comes from the position error
/// with a negative gain.
const MIN_REVERSED_SHARE: f64 = 0.3;
/// Largest relative variation of a gravity torque that is treated as constant.
const MAX_GRAVITY_VARIATION: f64 = 0.05;
/// Number of time blocks for the jackknife of a scale.
const BLOCKS: usize = 10;
/// Widths of smoothed sign functions that are tested, as shares of the joint's highest velocity.
const STEP_WIDTHS: [f64; 3] = [0.02, 0.08, 0.3];
/// Rows with torque below this share of the largest torque are not saturated.
const UNSATURATED_SHARE: f64 = 0.85;
/// Number of torque limits that are tested, evenly spaced up to the largest commanded torque.
const CLIP_TRIALS: usize = 40;

/// Kind of a candidate cause, without its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum TorqueCandidate {
    /// The torque has another positive scale.
    Scale,
    /// The sign of the torque is reversed.
    Sign,
    /// The torque is that of another joint.
    Exchanged,
    /// Gravity is missing.
    Gravity,
    /// Friction is missing.
    Friction,
    /// The torque is limited.
    Clipped,
}

impl TorqueCandidate {
    pub(super) const ALL: [Self; 6] =
        [Self::Scale, Self::Sign, Self::Exchanged, Self::Gravity, Self::Friction, Self::Clipped];
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fitted {
    pub(super) candidate: TorqueCandidate,
    /// Scale, torque limit (Nm, N), or index of the other joint.
    pub(super) value: f64,
    pub(super) explained: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Explanation {
    pub(super) scale: Option<f64>,
    pub(super) scale_std: Option<f64>,
    pub(super) difference_percent: f64,
    pub(super) commanded: Vec<f64>,
    pub(super) matters: bool,
    /// Squared difference as a share of the squared torque.
    pub(super) difference_share: f64,
    /// Whether the difference is reported even if its cause is unknown: it is based on a completely known control
    /// law, or it is a scale.
    pub(super) is_certain: bool,
    /// All candidates, best first; empty if the difference is not relevant.
    pub(super) candidates: Vec<Fitted>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct JointData<'a> {
    pub(super) task: &'a IterationTask,
    pub(super) torque: &'a [Vec<f64>],
    /// The first column is the commanded or feed-forward torque; other columns belong to the drives' own loop.
    pub(super) columns: &'a [JointColumns],
    pub(super) q: &'a [Vec<f64>],
    pub(super) dq: &'a [Vec<f64>],
    pub(super) ddq: &'a [Vec<f64>],
}

pub(super) fn explain(data: &JointData<'_>, joint: usize, settings: &TorqueCheckSettings) -> Explanation {
    let (y, columns) = (&data.torque[joint], &data.columns[joint]);
    let size = rms(y).max(f64::MIN_POSITIVE);
    let (first, own_loop) = columns.split_first().map_or((&[][..], &[][..]), |(first, rest)| (&first[..], rest));
    // Hypothesis of a correct log: the scale is one, with the fitted loop of the drives.
    let without_feed_forward: Vec<f64> = y.iter().zip(first).map(|(y, u)| y - u).collect();
    let difference = residual_of(own_loop, &without_feed_forward, &coefficients(own_loop, &without_feed_forward));
    let total = square(&difference).max(f64::MIN_POSITIVE);
    let free = coefficients(columns, y);
    let std = jackknife(columns, y);
    let (scale, scale_std) = (free[0], std[0]);
    let is_scaled = (scale - 1.0).abs() > (0.01 * settings.scale_percent).max(settings.sigmas * scale_std);
    // Drives that push away from the path could not follow it.
    let by_error = own_loop.first().map_or(0.0, |error| free[1] * rms(error));
    let pushes_away = by_error < -MIN_REVERSED_SHARE * size && free[1] < -settings.sigmas * std[1];
    let difference_percent = 100.0 * rms(&difference) / size;
    let lacks_weight = difference_percent <= settings.difference_percent
        && lacks_constant_gravity(data, joint, &without_feed_forward, settings.difference_percent);
    let matters = lacks_weight || is_scaled || pushes_away || difference_percent > settings.difference_percent;
    let mut out = Explanation {
        scale: scale_std.is_finite().then_some(scale),
        scale_std: scale_std.is_finite().then_some(scale_std),
        difference_percent,
        commanded: y.iter().zip(&difference).map(|(y, r)| y - r).collect(),
        matters,
        difference_share: total / (size * size * y.len().max(1) as f64),
        is_certain: own_loop.is_empty() || is_scaled,
        candidates: Vec::new(),
    };
    if !matters {
        return out;
    }
    if lacks_weight {
        out.candidates = vec![Fitted { candidate: TorqueCandidate::Gravity, value: 1.0, explained: 1.0 }];
        return out;
    }
    let free = Free { coefficients: &free, has_scale: scale_std.is_finite(), pushes_away };
    let candidates = candidates(data, joint, &free, &without_feed_forward, total);
    // Another joint with the same torque is not an alternative to the best candidate.
    for one in candidates {
        if !out.candidates.iter().any(|other| other.candidate == one.candidate) {
            out.candidates.push(one);
        }
    }
    out
}

struct Free<'a> {
    coefficients: &'a [f64],
    has_scale: bool,
    /// Whether the drive appears to push away from the path.
    pushes_away: bool,
}

/// Possible causes of the difference `beside` between a joint's logged and commanded torque, best first. `total` is
/// the squared difference without the part that the drives' own loop explains.
fn candidates(data: &JointData<'_>, joint: usize, free: &Free<'_>, beside: &[f64], total: f64) -> Vec<Fitted> {
    let (y, columns) = (&data.torque[joint], &data.columns[joint]);
    let own_loop = columns.get(1..).unwrap_or_default();
    // Per independent row, so that a candidate with many unknowns does not explain the difference by their number
    // alone.
    let independent = y.len() as f64 / CORRELATED_ROWS;
    let fitted = |candidate, value, left: &[f64], unknowns: usize| {
        let freedom = independent - unknowns as f64;
        let explained = 1.0 - square(left) / total * independent / freedom;
        (freedom >= MIN_DEGREES_OF_FREEDOM).then_some(Fitted { candidate, value, explained })
    };
    let mut candidates = Vec::new();
    let left = residual_of(columns, y, free.coefficients);
    if free.pushes_away {
        candidates.push(Fitted { candidate: TorqueCandidate::Sign, value: -1.0, explained: 1.0 });
    } else if free.has_scale {
        let scale = free.coefficients[0];
        let candidate = if scale < 0.0 { TorqueCandidate::Sign } else { TorqueCandidate::Scale };
        candidates.extend(fitted(candidate, scale, &left, 1));
    }
    candidates.extend(exchanged(data, joint, total).into_iter().filter(|_| independent >= MIN_DEGREES_OF_FREEDOM));
    // The missing torque, fitted together with the drives' own loop.
    let missing = |extra: &[Vec<f64>]| {
        let all: Vec<Vec<f64>> = extra.iter().chain(own_loop).cloned().collect();
        let found = coefficients(&all, beside);
        let left = residual_of(&all, beside, &found);
        let sum = |row: usize| -extra.iter().zip(&found).map(|(column, value)| column[row] * value).sum::<f64>();
        ((0..y.len()).map(sum).collect::<Vec<f64>>(), left)
    };
    if let Some(gravity) = gravity_columns(data, joint) {
        let columns = gravity.len();
        let (gravity, left) = missing(&gravity);
        if is_of_nominal_size(data, joint, &gravity) {
            candidates.extend(fitted(TorqueCandidate::Gravity, 1.0, &left, columns.min(2 * data.torque.len())));
        }
    }
    let friction = friction_columns(data, joint);
    let columns_of_friction = friction.len();
    let (friction, left) = missing(&friction);
    // Friction dissipates energy.
    if dot(&friction, &data.dq[joint]) > 0.0 {
        candidates.extend(fitted(TorqueCandidate::Friction, 1.0, &left, columns_of_friction));
    }
    candidates.extend(clipped(y, columns, total));
    candidates.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    candidates
}

pub(super) fn may_be_missing(data: &JointData<'_>) -> [Vec<Vec<Vec<f64>>>; 2] {
    let joints = 0..data.torque.len();
    let gravity = joints.clone().map(|joint| gravity_columns(data, joint).unwrap_or_default()).collect();
    [gravity, joints.map(|joint| friction_columns(data, joint)).collect()]
}

/// Columns of viscous friction, and of smoothed sign functions of several widths.
pub(super) fn friction_columns(data: &JointData<'_>, joint: usize) -> Vec<Vec<f64>> {
    let dq = &data.dq[joint];
    let fastest = dq.iter().fold(0.0_f64, |most, dq| most.max(dq.abs()));
    if fastest == 0.0 {
        return Vec::new();
    }
    let steps = STEP_WIDTHS.map(|width| dq.iter().map(|dq| (dq / (width * fastest)).tanh()).collect());
    core::iter::once(dq.clone()).chain(steps).collect()
}

fn exchanged(data: &JointData<'_>, joint: usize, total: f64) -> Vec<Fitted> {
    let y = &data.torque[joint];
    let of = |other: usize| {
        let (theirs, own_loop) = data.columns[other].split_first()?;
        let beside: Vec<f64> = y.iter().zip(theirs).map(|(y, u)| y - u).collect();
        let left = residual_of(own_loop, &beside, &coefficients(own_loop, &beside));
        let explained = 1.0 - square(&left) / total;
        Some(Fitted { candidate: TorqueCandidate::Exchanged, value: other as f64, explained })
    };
    (0..data.torque.len()).filter(|&other| other != joint).filter_map(of).collect()
}

/// Candidate of a torque limit. The gains of drives with their own loop are fitted to the rows below it.
fn clipped(y: &[f64], columns: &[Vec<f64>], total: f64) -> Option<Fitted> {
    let (first, own_loop) = columns.split_first()?;
    let highest = y.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
    let below: Vec<usize> = (0..y.len()).filter(|&row| y[row].abs() < UNSATURATED_SHARE * highest).collect();
    let kept = |values: &[f64]| -> Vec<f64> { below.iter().map(|&row| values[row]).collect() };
    let beside: Vec<f64> = y.iter().zip(first).map(|(y, u)| y - u).collect();
    let of_loop = coefficients(&own_loop.iter().map(|column| kept(column)).collect::<Vec<_>>(), &kept(&beside));
    let commanded: Vec<f64> = residual_of(own_loop, &beside, &of_loop).iter().zip(y).map(|(r, y)| y - r).collect();
    let most = commanded.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    let at = |share: usize| {
        let limit = most * share as f64 / CLIP_TRIALS as f64;
        let left = centred(&y.iter().zip(&commanded).map(|(y, u)| y - u.clamp(-limit, limit)).collect::<Vec<_>>());
        Fitted { candidate: TorqueCandidate::Clipped, value: limit, explained: 1.0 - square(&left) / total }
    };
    (1..CLIP_TRIALS).map(at).max_by(|a, b| a.explained.total_cmp(&b.explained))
}

/// Columns of the joint's gravity torque with respect to the mass and the first moments of each body.
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

/// Whether the constant that the log lacks is a gravity torque that does not depend on the posture, as for a vertical
/// slide. It must be half to twice that of the robot description, and more than the smallest relevant share of the
/// torque.
fn lacks_constant_gravity(data: &JointData<'_>, joint: usize, beside: &[f64], percent: f64) -> bool {
    let nominal = nominal_gravity(data, joint);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (weight, missing) = (mean(&nominal), -mean(beside));
    let is_constant = rms(&centred(&nominal)) < MAX_GRAVITY_VARIATION * weight.abs();
    is_constant
        && 100.0 * missing.abs() > percent * rms(&data.torque[joint])
        && (0.5..=2.0).contains(&(missing / weight))
}

fn nominal_gravity(data: &JointData<'_>, joint: usize) -> Vec<f64> {
    let model = data.task.robot.model();
    let mut workspace = Workspace::new(model);
    let mut q = vec![0.0; model.dof()];
    (0..data.torque[joint].len())
        .map(|row| {
            q.iter_mut().zip(data.q).for_each(|(to, from)| *to = from[row]);
            gravity_torque(model, &mut workspace, &q)[joint]
        })
        .collect()
}

/// Whether a torque is similar to the gravity torque of the robot description: same sign, and half to twice the size.
/// Any size is accepted if the robot description has no masses.
fn is_of_nominal_size(data: &JointData<'_>, joint: usize, missing: &[f64]) -> bool {
    let (nominal, missing) = (centred(&nominal_gravity(data, joint)), centred(missing));
    let own = square(&nominal);
    own == 0.0 || (0.5..=2.0).contains(&(dot(&nominal, &missing) / own))
}

/// Standard deviation of each coefficient by the jackknife over time blocks; infinite if the rows do not determine it.
fn jackknife(columns: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let rows = y.len();
    if rows < 2 * BLOCKS {
        return vec![f64::INFINITY; columns.len() + 1];
    }
    let without = |values: &[f64], block: usize| -> Vec<f64> {
        let (from, to) = (block * rows / BLOCKS, (block + 1) * rows / BLOCKS);
        values[..from].iter().chain(&values[to..]).copied().collect()
    };
    let found: Vec<Vec<f64>> = (0..BLOCKS)
        .map(|block| {
            let columns: Vec<Vec<f64>> = columns.iter().map(|column| without(column, block)).collect();
            coefficients(&columns, &without(y, block))
        })
        .collect();
    let count = BLOCKS as f64;
    let std = |k: usize| {
        let is_excited = columns.get(k).is_none_or(|column| rms(&centred(column)) > 1e-9 * rms(y));
        let mean = found.iter().map(|values| values[k]).sum::<f64>() / count;
        let square: f64 = found.iter().map(|values| (values[k] - mean).powi(2)).sum();
        if is_excited { ((count - 1.0) / count * square).sqrt() } else { f64::INFINITY }
    };
    (0..=columns.len()).map(std).collect()
}
