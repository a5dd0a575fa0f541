//! Classifies an event by the shape of its unexplained torque.

use crate::contact::share_by_wrench;
use crate::kind::EventKind;
use crate::rows::{LogRows, rms};
use crate::scan::{Interval, Scan, off_ranges, rests};
use core::ops::Range;
use dynident_dynamics::{BatchWorkspace, Column, PanelLayout, Panels, ParametricModel, regressor_panels};
use dynident_model::terms::JointMotion;
use nalgebra::{DMatrix, DVector};

/// Number of instants that are compared with a force and a moment on one link.
const INSTANTS: usize = 50;

pub(crate) struct Signature {
    /// Start and end, s.
    pub(crate) times_s: [f64; 2],
    pub(crate) kind: EventKind,
    pub(crate) alternative: Option<EventKind>,
    /// Joints with unexplained torque.
    pub(crate) joints: Vec<usize>,
    /// Joints whose torque the event can change.
    pub(crate) affected: Vec<usize>,
}

/// Classifies one interval.
pub(crate) fn signature(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> Signature {
    let mut found = classified(rows, robot, scan, one);
    if found.joints.is_empty() {
        found.joints.push(one.strongest);
    }
    let kinds = [Some(found.kind), found.alternative];
    let is_any = |of: &[EventKind]| kinds.iter().flatten().any(|kind| of.contains(kind));
    let model = robot.model();
    let is_below = |joint: usize| {
        let touched = |other: usize| {
            one.ratio[other] >= rows.settings.kind.min_touch_ratio && model.moves(joint, model.body_of(other))
        };
        (0..rows.joints()).any(touched)
    };
    found.affected = if is_any(&[EventKind::DrivesOff, EventKind::LoadChange, EventKind::Unexplained]) {
        (0..rows.joints()).collect()
    } else if is_any(&[EventKind::Contact]) {
        (0..rows.joints()).filter(|&joint| is_below(joint)).collect()
    } else {
        found.joints.clone()
    };
    found
}

fn classified(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> Signature {
    let (own, warn_ratio) = (rows.settings.kind, rows.settings.warn_ratio);
    let limit = warn_ratio.max(own.min_joint_ratio * one.ratio[one.strongest]);
    let joints: Vec<usize> = (0..rows.joints()).filter(|&joint| one.ratio[joint] >= limit).collect();
    let [from_s, to_s] = times(rows, &one.bins);
    let of = |kind: EventKind| {
        let lasts = matches!(kind, EventKind::DrivesOff | EventKind::LoadChange | EventKind::OffsetChange);
        let off = off_ranges(rows, &one.bins).filter(|_| kind == EventKind::DrivesOff);
        let times_s = off.map_or([from_s, to_s], |[_, off]| times(rows, &off));
        let times_s = if lasts { extended(rows, times_s) } else { times_s };
        Signature { times_s, kind, alternative: None, joints: joints.clone(), affected: Vec::new() }
    };
    let at_rest: Vec<bool> = (0..rows.joints()).map(|joint| rests(rows, &one.bins, joint)).collect();
    if one.is_off || at_rest.iter().all(|rest| *rest) && is_torque_off(rows, scan, one, &joints) {
        return of(EventKind::DrivesOff);
    }
    let [first_s, last_s] = reliable(rows);
    let persists = to_s + own.end_s >= last_s || from_s - own.end_s <= first_s;
    let (load, offset) = if persists { load_and_offset(rows, robot, scan, one) } else { (0.0, 0.0) };
    if one.is_stop {
        let alternative = (joints.len() > 1).then_some(EventKind::Contact);
        let times_s = time_at_stop(rows, one);
        return Signature { times_s, alternative, joints: vec![one.strongest], ..of(EventKind::JointStop) };
    }
    if persists && offset >= own.min_explained_share && joints.len() == 1 && offset >= load - own.max_load_lead {
        return Signature { alternative: Some(EventKind::Drift), ..of(EventKind::OffsetChange) };
    }
    if persists && load >= own.min_explained_share {
        return Signature { alternative: Some(EventKind::Contact), ..of(EventKind::LoadChange) };
    }
    if contact_share(rows, robot, scan, one) >= own.min_explained_share {
        return of(EventKind::Contact);
    }
    if at_rest.iter().all(|rest| *rest) {
        return Signature { alternative: Some(EventKind::Contact), ..of(EventKind::DrivesOff) };
    }
    Signature { alternative: Some(EventKind::Contact), ..of(EventKind::Unexplained) }
}

/// Start and end time of a range of bins, s.
fn times(rows: &LogRows, bins: &Range<usize>) -> [f64; 2] {
    let half = 0.5 * rows.bin_s;
    [(rows.time_s[bins.start] - half).max(0.0), rows.time_s[bins.end - 1] + half]
}

/// Start and end of the interval with the adjacent bins in which the joint also rests: at a stop, the torque grows from
/// zero.
fn time_at_stop(rows: &LogRows, one: &Interval) -> [f64; 2] {
    let joint = one.strongest;
    let rests = |bin: &usize| rows.dq[joint][*bin].abs() <= rows.rest[joint];
    let before = (0..one.bins.start).rev().take_while(rests).last().unwrap_or(one.bins.start);
    let after = (one.bins.end..rows.len()).take_while(rests).last().unwrap_or(one.bins.end - 1);
    let half = 0.5 * rows.bin_s;
    [rows.time_s[before] - half, rows.time_s[after] + half]
}

/// Start and end of an event that lasts to the start or the end of the log.
fn extended(rows: &LogRows, [from_s, to_s]: [f64; 2]) -> [f64; 2] {
    let half = 0.5 * rows.bin_s;
    let (first_s, last_s) = ((rows.time_s[0] - half).max(0.0), rows.time_s[rows.len() - 1] + half);
    let (reliable, end_s) = (reliable(rows), rows.settings.kind.end_s);
    let from_s = if from_s - end_s <= reliable[0] { first_s } else { from_s };
    [from_s, if to_s + end_s >= reliable[1] { last_s } else { to_s }]
}

/// Times of the first and the last bin with reliable motion, s; start and end of the log if there are no such bins. If
/// a log starts or ends in motion, the bins there are not reliable.
fn reliable(rows: &LogRows) -> [f64; 2] {
    let first = rows.usable.iter().position(|usable| *usable).unwrap_or(0);
    let last = rows.usable.iter().rposition(|usable| *usable).unwrap_or(rows.len() - 1);
    [rows.time_s[first], rows.time_s[last]]
}

fn is_torque_off(rows: &LogRows, scan: &Scan, one: &Interval, joints: &[usize]) -> bool {
    let (mut measured, mut predicted) = (0.0, 0.0);
    for &joint in joints {
        let weight = rms(&rows.tau[joint]).powi(-2);
        for bin in one.bins.clone() {
            measured += weight * rows.tau[joint][bin].powi(2);
            predicted += weight * (rows.tau[joint][bin] - scan.residuals[joint][bin]).powi(2);
        }
    }
    measured <= rows.settings.drives_off.max_measured_ratio * predicted
}

/// Two shares of the squared residual in the interval: the share that other masses at the last link explain, and the
/// share that a constant torque of the joint with the strongest evidence explains.
fn load_and_offset(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> (f64, f64) {
    let strongest = one.strongest;
    let left = |joint: usize, bin: usize| scan.residuals[joint][bin] / scan.variance[joint][bin].sqrt();
    let squares = |joint: usize| one.bins.clone().map(|bin| left(joint, bin).powi(2)).sum::<f64>();
    let all: f64 = (0..rows.joints()).map(squares).sum();
    let weights: f64 = one.bins.clone().map(|bin| scan.variance[strongest][bin].recip()).sum();
    let weighted: f64 =
        one.bins.clone().map(|bin| scan.residuals[strongest][bin] / scan.variance[strongest][bin]).sum();
    let offset = weighted * weighted / weights / all;
    (load_share(rows, robot, scan, one), offset)
}

fn load_share(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> f64 {
    let model = robot.model();
    let body = model.body_count() - 1;
    // A payload changes mainly the mass and the centre of mass.
    let columns: Vec<Column> = (0..4).map(|parameter| Column::Body { body, parameter }).collect();
    let layout = PanelLayout::new(model, columns);
    let bins: Vec<usize> = one.bins.clone().collect();
    let samples = bins.len();
    let of = |values: &[Vec<f64>]| -> Vec<f64> {
        values.iter().flat_map(|joint| bins.iter().map(|&bin| joint[bin])).collect()
    };
    let acceleration: Vec<Vec<f64>> = rows.dq.iter().map(|dq| differences(dq, rows.bin_s)).collect();
    let (q, dq, ddq) = (of(&rows.q), of(&rows.dq), of(&acceleration));
    let motion = JointMotion { samples, q: &q, dq: &dq, ddq: &ddq };
    let mut panels = Panels::default();
    regressor_panels(model, &mut BatchWorkspace::new(model), &layout, &motion, &mut panels);
    let (mut gram, mut right, mut all) = (DMatrix::<f64>::zeros(4, 4), DVector::<f64>::zeros(4), 0.0);
    for joint in 0..rows.joints() {
        let panel = panels.joint(joint);
        let at_bins = |value: &dyn Fn(usize) -> f64| {
            DVector::from_iterator(samples, bins.iter().map(|&bin| value(bin) / scan.variance[joint][bin].sqrt()))
        };
        // Friction that grows with the load cannot be determined in an interval without the load.
        let friction = at_bins(&|bin| rows.row(joint, bin).last().copied().unwrap_or(0.0));
        let size = friction.norm_squared().max(f64::MIN_POSITIVE);
        let without_friction = |values: DVector<f64>| &values - &friction * (friction.dot(&values) / size);
        let left = without_friction(at_bins(&|bin| scan.residuals[joint][bin]));
        all += left.norm_squared();
        let places = layout.joint_columns(joint);
        let columns: Vec<DVector<f64>> = (0..places.len())
            .map(|a| {
                let values = bins.iter().enumerate();
                let scaled = values.map(|(k, &bin)| panel[a * samples + k] / scan.variance[joint][bin].sqrt());
                without_friction(DVector::from_iterator(samples, scaled))
            })
            .collect();
        for (column, &place) in columns.iter().zip(places) {
            right[place] += column.dot(&left);
            for (other, &at) in columns.iter().zip(places) {
                gram[(place, at)] += column.dot(other);
            }
        }
    }
    let ridge = 1e-9 * gram.trace() / 4.0 + f64::MIN_POSITIVE;
    for place in 0..4 {
        gram[(place, place)] += ridge;
    }
    gram.cholesky().map_or(0.0, |factor| factor.solve(&right).dot(&right) / all.max(f64::MIN_POSITIVE))
}

fn differences(values: &[f64], step: f64) -> Vec<f64> {
    let last = values.len() - 1;
    (0..values.len()).map(|at| (values[(at + 1).min(last)] - values[at.saturating_sub(1)]) / (2.0 * step)).collect()
}

/// Largest share of the squared residual that a force and a moment on one link explain.
fn contact_share(rows: &LogRows, robot: &ParametricModel, scan: &Scan, one: &Interval) -> f64 {
    let model = robot.model();
    let stride = one.bins.len().div_ceil(INSTANTS).max(1);
    let bins: Vec<usize> = one.bins.clone().step_by(stride).collect();
    let at = |values: &[Vec<f64>], bin: usize| -> Vec<f64> { values.iter().map(|joint| joint[bin]).collect() };
    let positions: Vec<Vec<f64>> = bins.iter().map(|&bin| at(&rows.q, bin)).collect();
    let torques: Vec<Vec<f64>> = bins.iter().map(|&bin| at(&scan.residuals, bin)).collect();
    let weights: Vec<f64> = (0..rows.joints())
        .map(|joint| {
            let of_bins = bins.iter().map(|&bin| scan.variance[joint][bin]).sum::<f64>();
            (of_bins / bins.len() as f64).sqrt().recip()
        })
        .collect();
    let shares = (0..model.body_count()).map(|body| share_by_wrench(model, &positions, &torques, &weights, body));
    shares.fold(0.0, f64::max)
}
