//! Search for intervals whose torque a model of the other bins does not explain.

use crate::noise::usual_variance;
use crate::normal::Normal;
use crate::quiet::quiet;
use crate::robust::{Blocks, Fit, dry_friction, residuals};
use crate::rows::{LogRows, rms};
use crate::settings::EventSettings;
use core::ops::Range;
use nalgebra::DVector;

/// Rounds of search and refit.
const ROUNDS: usize = 4;

/// An interval with unexplained torque, and the evidence.
#[derive(Clone, Debug)]
pub(crate) struct Interval {
    pub(crate) bins: Range<usize>,
    /// Mean square of the unexplained torque of each joint.
    pub(crate) excess: Vec<f64>,
    /// Mean square of the unexplained torque of each joint, relative to the usual residual variance.
    pub(crate) ratio: Vec<f64>,
    /// Mean square of the unexplained torque of each joint, relative to the worst other interval of this length.
    pub(crate) prominence: Vec<f64>,
    /// Root mean square of the unexplained torque of each joint, relative to the torque of the joint.
    pub(crate) effect: Vec<f64>,
    /// Joint with the strongest evidence.
    pub(crate) strongest: usize,
    /// Whether all joints rest and the torque that carries their weight is missing.
    pub(crate) is_off: bool,
    /// Whether one joint rests at the end of its range with more torque than its friction, while other joints move.
    pub(crate) is_stop: bool,
    pub(crate) is_clear: bool,
}

/// Result of the search: intervals, and the model of the bins outside of them.
pub(crate) struct Scan {
    pub(crate) intervals: Vec<Interval>,
    pub(crate) residuals: Vec<Vec<f64>>,
    pub(crate) variance: Vec<Vec<f64>>,
    /// Whether each bin is outside of all intervals.
    pub(crate) kept: Vec<bool>,
}

/// Searches one log. Events must also be events `with_presliding` friction, which only joints that keep the friction of
/// their last motion at rest have. `None` if the log has too few rows.
pub(crate) fn scan(rows: &LogRows, with_presliding: &LogRows) -> Option<Scan> {
    let blocks = Blocks::new(rows);
    let mut fit = blocks.trimmed_fit()?;
    let mut kept = vec![true; rows.len()];
    let mut found: Vec<Range<usize>> = Vec::new();
    for _ in 0..ROUNDS {
        let left = residuals(rows, &fit);
        let variance = usual_variance(rows, &left, &dry_friction(rows, &fit), &kept);
        let next = candidates(rows, &left, &variance);
        if next == found {
            break;
        }
        kept.fill(true);
        for range in &next {
            kept[range.clone()].fill(false);
        }
        found = next;
        fit = blocks.fit(&kept)?.1;
    }
    // If a joint's fit can explain an interval, it is unusual motion and becomes part of the fit again.
    loop {
        let (sums, refit) = blocks.fit(&kept)?;
        let left = residuals(rows, &refit);
        let variance = usual_variance(rows, &left, &dry_friction(rows, &refit), &kept);
        let judged: Vec<Interval> =
            found.iter().filter_map(|range| judged(rows, range, &kept, &sums, &refit, &left, &variance)).collect();
        let confirmed = [rows, with_presliding]
            .iter()
            .fold(found.clone(), |events, model| confirmed_events(model, &events, &kept, &variance));
        let is_kept = |one: &&Interval| {
            one.is_off || one.is_stop || one.passes_warning(&rows.settings) && confirmed.contains(&one.bins)
        };
        let remaining: Vec<Range<usize>> = judged.iter().filter(is_kept).map(|one| one.bins.clone()).collect();
        if remaining.len() == found.len() {
            return Some(Scan { intervals: judged, residuals: left, variance, kept });
        }
        found = remaining;
        kept.fill(true);
        for range in &found {
            kept[range.clone()].fill(false);
        }
    }
}

/// The intervals that are also events if each bin has the weight `1 / variance`. The dry friction of a joint at rest is
/// any torque up to the breakaway torque. A fit with equal weights follows the values of some rests, and the others
/// contradict it.
fn confirmed_events(rows: &LogRows, found: &[Range<usize>], kept: &[bool], variance: &[Vec<f64>]) -> Vec<Range<usize>> {
    if found.is_empty() {
        return Vec::new();
    }
    let rows = &rows.weighted(variance);
    let Some((sums, fit)) = Blocks::new(rows).fit(kept) else { return Vec::new() };
    let left = residuals(rows, &fit);
    let friction: Vec<f64> =
        dry_friction(rows, &fit).iter().map(|friction| rows.settings.intervals.breakaway_ratio * friction).collect();
    let variance = usual_variance(rows, &left, &friction, kept);
    let judged = found.iter().filter_map(|range| judged(rows, range, kept, &sums, &fit, &left, &variance));
    judged.filter(|one| one.passes_warning(&rows.settings)).map(|one| one.bins).collect()
}

impl Interval {
    fn passes_warning(&self, settings: &EventSettings) -> bool {
        self.passes(settings.warn_ratio, settings.warn_prominence, settings.min_effect)
    }

    fn passes(&self, ratio: f64, prominence: f64, effect: f64) -> bool {
        (0..self.ratio.len()).any(|joint| {
            self.ratio[joint] >= ratio && self.prominence[joint] >= prominence && self.effect[joint] >= effect
        })
    }
}

/// Disjoint intervals with the largest sums of relative square residuals above
/// [`bin_ratio`](crate::IntervalSettings::bin_ratio), in order of time.
fn candidates(rows: &LogRows, left: &[Vec<f64>], variance: &[Vec<f64>]) -> Vec<Range<usize>> {
    let own = rows.settings.intervals;
    let gain = |bin: usize| {
        if !rows.usable[bin] {
            return -own.unusable_loss;
        }
        let ratios = (0..rows.joints()).map(|joint| left[joint][bin].powi(2) / variance[joint][bin]);
        ratios.fold(0.0, f64::max).min(own.max_bin_ratio) - own.bin_ratio
    };
    let mut gains: Vec<f64> = (0..rows.len()).map(gain).collect();
    let mut found: Vec<Range<usize>> = Vec::new();
    while found.len() < own.max_intervals {
        let Some((range, sum)) = best_interval(&gains) else { break };
        if sum < own.min_sum || range.len() < own.min_bins {
            break;
        }
        gains[range.clone()].fill(f64::NEG_INFINITY);
        found.push(range);
    }
    found.extend(without_torque(rows));
    found.sort_by_key(|range| range.start);
    let apart = (own.merge_s / rows.bin_s).ceil() as usize;
    let mut merged: Vec<Range<usize>> = Vec::new();
    for range in found {
        match merged.last_mut() {
            Some(last) if range.start <= last.end + apart => last.end = last.end.max(range.end),
            _ => merged.push(range),
        }
    }
    merged
}

/// Ranges of at least [`min_duration_s`](crate::DrivesOffSettings::min_duration_s) in which all joints rest with little
/// torque: the drives are off, or the posture requires no torque.
fn without_torque(rows: &LogRows) -> Vec<Range<usize>> {
    let (own, is_quiet) = (rows.settings.drives_off, quiet(rows));
    let mut found: Vec<Range<usize>> = Vec::new();
    for bin in (0..rows.len()).filter(|&bin| is_quiet[bin] && !rows.is_moving(bin)) {
        match found.last_mut() {
            Some(last) if last.end + own.max_gap_bins >= bin => last.end = bin + 1,
            _ => found.push(bin..bin + 1),
        }
    }
    found.retain(|range| range.len() as f64 * rows.bin_s >= own.min_duration_s);
    found
}

/// Two ranges: the longest rest without torque inside `range`, and this rest extended by the adjacent bins without
/// torque. The extension is necessary because brakes stop the robot after the torque ends, and the torque returns
/// before the motion.
pub(crate) fn off_ranges(rows: &LogRows, range: &Range<usize>) -> Option<[Range<usize>; 2]> {
    let inside = without_torque(rows).into_iter().filter(|off| off.start < range.end && off.end > range.start);
    let at_rest = inside.max_by_key(Range::len)?;
    let is_quiet = quiet(rows);
    let from = (0..at_rest.start).rev().take_while(|&bin| is_quiet[bin]).last().unwrap_or(at_rest.start);
    let to = (at_rest.end..rows.len()).take_while(|&bin| is_quiet[bin]).last().map_or(at_rest.end, |bin| bin + 1);
    Some([at_rest, from..to])
}

/// The interval with the largest sum of `gains`, and this sum.
fn best_interval(gains: &[f64]) -> Option<(Range<usize>, f64)> {
    let (mut sum, mut from) = (0.0, 0);
    let mut best: Option<(Range<usize>, f64)> = None;
    for (bin, gain) in gains.iter().enumerate() {
        if sum <= 0.0 {
            (sum, from) = (0.0, bin);
        }
        sum += gain;
        if sum > 0.0 && best.as_ref().is_none_or(|(_, most)| sum > *most) {
            best = Some((from..bin + 1, sum));
        }
    }
    best
}

/// Evidence for one interval: the increase of the squared residuals if the bins of the interval are added to the fit of
/// the other bins.
fn judged(
    rows: &LogRows,
    range: &Range<usize>,
    kept: &[bool],
    sums: &[Normal],
    fit: &Fit,
    left: &[Vec<f64>],
    variance: &[Vec<f64>],
) -> Option<Interval> {
    let (settings, joints) = (&rows.settings, rows.joints());
    let mut one = Interval {
        bins: range.clone(),
        excess: vec![0.0; joints],
        ratio: vec![0.0; joints],
        prominence: vec![0.0; joints],
        effect: vec![0.0; joints],
        strongest: 0,
        is_off: false,
        is_stop: false,
        is_clear: false,
    };
    let largest = rows.tau.iter().map(|tau| rms(tau)).fold(f64::MIN_POSITIVE, f64::max);
    for joint in 0..joints {
        let inside = Normal::of_range(rows, joint, range.clone(), |_| true, |_, _| ());
        if inside.weight == 0.0 {
            continue;
        }
        let mut both = sums[joint].clone();
        both.add(&inside);
        let increase = both.squares(&both.solution()?) - sums[joint].squares(&fit[joint]);
        let excess = (increase / inside.weight).max(0.0);
        // Bins with a well-known torque count most.
        let usual = range.len() as f64 / variance[joint][range.clone()].iter().map(|one| one.recip()).sum::<f64>();
        one.excess[joint] = excess;
        one.ratio[joint] = excess / usual;
        let weight = &rows.weight[joint];
        let mean_weight = weight[range.clone()].iter().sum::<f64>() / range.len() as f64;
        let worst = worst_window(rows, &left[joint], weight, kept, range.len()) / mean_weight;
        one.prominence[joint] = excess / worst.max(rows.settings.intervals.min_other_ratio * usual);
        one.effect[joint] =
            excess.sqrt() / rms(&rows.tau[joint]).max(rows.settings.drives_off.min_reference_ratio * largest);
    }
    one.strongest = (0..joints).max_by(|a, b| one.ratio[*a].total_cmp(&one.ratio[*b])).unwrap_or(0);
    one.is_off = off_ranges(rows, range).is_some_and(|[at_rest, _]| is_off(rows, &at_rest, left, variance));
    let is_at_stop = |joint: &usize| {
        let effect = one.effect[*joint].max(mean_effect(rows, range, &left[*joint], *joint));
        let of_prediction = prediction_variance(rows, range, *joint, &sums[*joint]);
        let usual: Vec<f64> = variance[*joint].iter().map(|usual| usual * (1.0 + of_prediction)).collect();
        effect >= settings.min_effect && is_stop(rows, range, *joint, &left[*joint], &usual)
    };
    let at_stop = (0..joints).find(is_at_stop);
    one.is_stop = at_stop.is_some_and(|joint| others_move(rows, range, joint));
    if let (true, Some(joint)) = (one.is_stop, at_stop) {
        one.strongest = joint;
    }
    let share = range.len() as f64 / rows.len() as f64;
    let is_evident = one.passes(settings.clear_ratio, settings.clear_prominence, settings.clear_effect);
    // A robot whose drives are off is never the normal state, for any share of the log.
    one.is_clear = one.is_off || (one.is_stop || is_evident) && share <= settings.max_share;
    Some(one)
}

/// Whether one joint rests in most bins of a range.
pub(crate) fn rests(rows: &LogRows, range: &Range<usize>, joint: usize) -> bool {
    let still = range.clone().filter(|&bin| rows.dq[joint][bin].abs() <= rows.rest[joint]).count();
    still as f64 >= rows.settings.drives_off.min_rest_share * range.len() as f64
}

/// Whether another joint moves clearly while joint `resting` is at rest.
fn others_move(rows: &LogRows, range: &Range<usize>, resting: usize) -> bool {
    let still = || range.clone().filter(|&bin| rows.dq[resting][bin].abs() <= rows.rest[resting]);
    let travel = |q: &mut dyn Iterator<Item = f64>| {
        let (low, high) = q.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(q), high.max(q)));
        high - low
    };
    let moves = |joint: usize| {
        let q = &rows.q[joint];
        travel(&mut still().map(|bin| q[bin])) >= rows.settings.stop.min_other_travel * travel(&mut q.iter().copied())
    };
    (0..rows.joints()).any(|joint| joint != resting && moves(joint))
}

/// Root mean square residual of a joint in a range, relative to the torque of the joint.
fn mean_effect(rows: &LogRows, range: &Range<usize>, left: &[f64], joint: usize) -> f64 {
    rms(&left[range.clone()]) / rms(&rows.tau[joint]).max(f64::MIN_POSITIVE)
}

/// Variance of the mean torque in a range that the fit of the other bins predicts, relative to their usual residual.
fn prediction_variance(rows: &LogRows, range: &Range<usize>, joint: usize, others: &Normal) -> f64 {
    let mut mean = DVector::zeros(rows.width[joint]);
    for bin in range.clone() {
        mean += DVector::from_column_slice(rows.row(joint, bin)) / range.len() as f64;
    }
    others.leverage(&mean).unwrap_or(f64::INFINITY)
}

/// Whether one joint rests at the end of its range with a residual that presses against this end and is larger than its
/// friction. The free parameters of the joint could explain such a torque in a single posture, so this is tested
/// separately.
fn is_stop(rows: &LogRows, range: &Range<usize>, joint: usize, left: &[f64], variance: &[f64]) -> bool {
    let own = rows.settings.stop;
    let mean = |values: &[f64]| values[range.clone()].iter().sum::<f64>() / range.len() as f64;
    let q = &rows.q[joint];
    let (low, high) = q.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| (low.min(*q), high.max(*q)));
    let near = own.max_distance * (high - low);
    let pressed = mean(left);
    let is_against_end = mean(q) <= low + near && pressed < 0.0 || mean(q) >= high - near && pressed > 0.0;
    is_against_end && rests(rows, range, joint) && pressed.powi(2) > own.min_residual_ratio * mean(variance)
}

/// Whether all joints rest with small torques, and some joint lacks the torque that carries the weight. A single
/// posture hardly changes a fit, so this is tested separately.
fn is_off(rows: &LogRows, range: &Range<usize>, left: &[Vec<f64>], variance: &[Vec<f64>]) -> bool {
    let (own, joints) = (rows.settings.drives_off, rows.joints());
    if !(0..joints).all(|joint| rests(rows, range, joint)) {
        return false;
    }
    let mean = |value: &dyn Fn(usize) -> f64| range.clone().map(value).sum::<f64>() / range.len() as f64;
    let (mut is_missing, mut measured, mut predicted) = (false, 0.0, 0.0);
    for joint in 0..joints {
        let scale = rms(&rows.tau[joint]).max(f64::MIN_POSITIVE).powi(2);
        let tau = mean(&|bin| rows.tau[joint][bin].powi(2));
        let model = mean(&|bin| (rows.tau[joint][bin] - left[joint][bin]).powi(2));
        let usual = mean(&|bin| variance[joint][bin]);
        measured += tau / scale;
        predicted += model / scale;
        is_missing |= model > own.min_predicted_size * usual && model > own.min_predicted_ratio * tau;
    }
    is_missing && predicted > own.min_predicted_ratio * measured
}

/// Largest mean weighted square residual of the kept bins over windows of this length.
fn worst_window(rows: &LogRows, left: &[f64], weight: &[f64], kept: &[bool], length: usize) -> f64 {
    let is_used = |bin: usize| kept[bin] && rows.usable[bin];
    let square = |bin: usize| if is_used(bin) { weight[bin] * left[bin].powi(2) } else { 0.0 };
    let length = length.min(rows.len());
    let mut sum: f64 = (0..length).map(square).sum();
    let mut worst = sum;
    for bin in length..rows.len() {
        sum += square(bin) - square(bin - length);
        worst = worst.max(sum);
    }
    worst / length.max(1) as f64
}
