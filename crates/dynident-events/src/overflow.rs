//! Overflow of the number format of a torque: the value jumps from one end of its range to the other.

use crate::normal::Normal;
use crate::robust::dry_friction_of_joint;
use crate::rows::{LogRows, TorquePiece, median};
use crate::settings::OverflowSettings;

/// Rounds of fit and assignment of the parts.
const ROUNDS: usize = 5;

/// Overflow of the torque number of one joint.
pub(crate) struct Overflow {
    pub(crate) joint: usize,
    /// Start and end of each interval with overflow, s.
    pub(crate) times_s: Vec<[f64; 2]>,
    /// Size of the jump, Nm or N.
    pub(crate) jump_nm: f64,
    /// Root mean square residual of the joint outside of the intervals, Nm or N.
    pub(crate) usual_nm: f64,
}

/// A part of the log between two jumps.
#[derive(Debug)]
struct Part {
    times_s: [f64; 2],
    bins: Vec<usize>,
    is_wrapped: bool,
}

/// Joints whose torque jumps to the other end of its range and back. In between, the residual of a model that was
/// fitted to the other parts must equal the size of the jump.
pub(crate) fn overflows(rows: &LogRows) -> Vec<Overflow> {
    (0..rows.joints()).filter_map(|joint| overflow(rows, joint)).collect()
}

fn overflow(rows: &LogRows, joint: usize) -> Option<Overflow> {
    let (parts, jumps) = parts(rows, joint);
    if jumps.is_empty() {
        return None;
    }
    let jump_nm = median(jumps.iter().map(|(_, size)| *size).collect());
    long_overflow(rows, joint, parts, &jumps, jump_nm).or_else(|| short_overflow(rows, joint, &jumps, jump_nm))
}

/// Overflow at peaks that are shorter than the parts of [`long_overflow`]: the torque jumps over its range and back
/// several times, by much more than dry friction does at a reversal.
fn short_overflow(rows: &LogRows, joint: usize, jumps: &[(f64, f64)], jump_nm: f64) -> Option<Overflow> {
    let own = rows.settings.overflow;
    let times_s = merged(rows, intervals(jumps, own.max_short_s));
    if times_s.len() < own.min_short_intervals {
        return None;
    }
    let is_near = |time_s: f64| {
        let is_within = |[from, to]: &[f64; 2]| time_s > from - own.max_short_s && time_s < to + own.max_short_s;
        times_s.iter().any(is_within)
    };
    let fit = Normal::of_range(rows, joint, 0..rows.len(), |bin| !is_near(rows.time_s[bin]), |_, _| ());
    let theta = fit.solution()?;
    let usual_nm = (fit.squares(&theta) / fit.weight).sqrt();
    let friction_nm = dry_friction_of_joint(rows, joint, &theta);
    let is_overflow =
        jump_nm > own.min_friction_ratio * friction_nm && jump_nm.powi(2) > own.min_residual_ratio * usual_nm.powi(2);
    is_overflow.then_some(Overflow { joint, times_s, jump_nm, usual_nm })
}

/// Intervals between two jumps that are at most `longest_s` apart.
fn intervals(jumps: &[(f64, f64)], longest_s: f64) -> Vec<[f64; 2]> {
    jumps.windows(2).map(|two| [two[0].0, two[1].0]).filter(|[from, to]| to - from <= longest_s).collect()
}

/// Intervals in order of time; those with less than a bin in between are one.
fn merged(rows: &LogRows, mut times_s: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    times_s.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut merged: Vec<[f64; 2]> = Vec::new();
    for [from, to] in times_s {
        match merged.last_mut() {
            Some(last) if from - last[1] <= rows.bin_s => last[1] = last[1].max(to),
            _ => merged.push([from, to]),
        }
    }
    merged
}

/// Overflow of parts of the log of at least [`min_bins`](OverflowSettings::min_bins) bins.
fn long_overflow(
    rows: &LogRows,
    joint: usize,
    mut parts: Vec<Part>,
    jumps: &[(f64, f64)],
    jump_nm: f64,
) -> Option<Overflow> {
    let (own, mut usual_nm) = (rows.settings.overflow, 0.0);
    let fit_of = |parts: &[Part], is_used: &dyn Fn(&Part) -> bool| {
        let mut used = vec![false; rows.len()];
        parts.iter().filter(|part| is_used(part)).flat_map(|part| &part.bins).for_each(|&bin| used[bin] = true);
        let fit = Normal::of_range(rows, joint, 0..rows.len(), |bin| used[bin], |_, _| ());
        fit.solution().map(|theta| ((fit.squares(&theta) / fit.weight.max(1.0)).sqrt(), theta))
    };
    for _ in 0..ROUNDS {
        let theta;
        (usual_nm, theta) = fit_of(&parts, &|part| !part.is_wrapped)?;
        let residual = |bin: &usize| -> f64 {
            rows.tau[joint][*bin] - rows.row(joint, *bin).iter().zip(theta.iter()).map(|(a, b)| a * b).sum::<f64>()
        };
        let mut is_same = true;
        for part in &mut parts {
            let mean = part.bins.iter().map(residual).sum::<f64>() / part.bins.len() as f64;
            let is_wrapped = (own.min_jump_ratio..own.max_jump_ratio).contains(&(mean.abs() / jump_nm));
            is_same &= is_wrapped == part.is_wrapped;
            part.is_wrapped = is_wrapped;
        }
        if is_same {
            break;
        }
    }
    let wrapped: usize = parts.iter().filter(|part| part.is_wrapped).map(|part| part.bins.len()).sum();
    let all_nm = fit_of(&parts, &|_| true)?.0;
    let is_explained = all_nm.powi(2) < own.min_residual_ratio * usual_nm.powi(2);
    if wrapped == 0 || wrapped as f64 > own.max_share * rows.len() as f64 || is_explained {
        return None;
    }
    let mut times_s: Vec<[f64; 2]> = parts.iter().filter(|part| part.is_wrapped).map(|part| part.times_s).collect();
    // Noise at the limit of the range jumps several times.
    times_s.extend(intervals(jumps, own.max_noise_bins * rows.bin_s));
    Some(Overflow { joint, times_s: merged(rows, times_s), jump_nm, usual_nm })
}

/// Parts of the log between two jumps of a joint's torque, and time and size of each jump. Parts of less than
/// [`min_bins`](OverflowSettings::min_bins) bins are omitted. After an odd number of jumps, a torque at one end of the
/// range has overflowed.
fn parts(rows: &LogRows, joint: usize) -> (Vec<Part>, Vec<(f64, f64)>) {
    let own = rows.settings.overflow;
    let all = || rows.samples.iter().flat_map(|piece| piece.tau[joint].iter().copied());
    let (low, high) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), tau| (low.min(tau), high.max(tau)));
    let (mut parts, mut sizes) = (Vec::new(), Vec::new());
    for piece in &rows.samples {
        let samples = piece.tau[joint].len();
        let time_s = |at: usize| piece.first_s + at as f64 / piece.rate_hz;
        let found = jumps(piece, joint, [low, high], &own);
        sizes.extend(found.iter().map(|(at, size)| (time_s(*at), size.abs())));
        let ends = found.iter().map(|(at, _)| *at).chain([samples]);
        let (mut from, mut count) = (0, 0_i32);
        for (number, to) in ends.enumerate() {
            let times_s = [time_s(from), time_s(to.max(1) - 1)];
            let is_inside = |bin: &usize| {
                let half = 0.5 * rows.bin_s;
                rows.usable[*bin] && rows.time_s[*bin] - half >= times_s[0] && rows.time_s[*bin] + half <= times_s[1]
            };
            let bins: Vec<usize> = (0..rows.len()).filter(is_inside).collect();
            let moving = bins.iter().filter(|&&bin| rows.is_moving(bin)).count();
            // Parts at rest are omitted here; the test for drives that are off examines them.
            if bins.len() >= own.min_bins && 2 * moving >= bins.len() {
                parts.push(Part { times_s, bins, is_wrapped: count != 0 });
            }
            count += found.get(number).map_or(0, |(_, size)| if *size < 0.0 { 1 } else { -1 });
            from = to;
        }
    }
    // The state (overflowed or not) that lasts longer is treated as normal.
    let length = |is_wrapped: bool| -> usize {
        parts.iter().filter(|part| part.is_wrapped == is_wrapped).map(|part| part.bins.len()).sum()
    };
    if length(true) > length(false) {
        for part in &mut parts {
            part.is_wrapped = !part.is_wrapped;
        }
    }
    (parts, sizes)
}

/// First sample after each jump from one end of the range (`low`, `high`) to the other, and the change of the torque.
fn jumps(piece: &TorquePiece, joint: usize, [low, high]: [f64; 2], own: &OverflowSettings) -> Vec<(usize, f64)> {
    let near = own.max_end_distance * (high - low);
    let longest = ((own.max_jump_s * piece.rate_hz) as usize).max(1);
    let (mut last, mut found) = ([None::<usize>; 2], Vec::new());
    let tau = &piece.tau[joint];
    for (at, value) in tau.iter().enumerate() {
        let end = if *value <= low + near {
            0
        } else if *value >= high - near {
            1
        } else {
            continue;
        };
        if let (Some(other), own) = (last[1 - end], last[end])
            && at - other <= longest
            && own.is_none_or(|own| own < other)
        {
            found.push((at, value - tau[other]));
        }
        last[end] = Some(at);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrapped_sine_jumps_twice_a_period_and_a_sine_never() {
        let sine: Vec<f64> = (0..1000).map(|k| 12.0 * (0.01 * f64::from(k)).sin()).collect();
        let tau: Vec<f64> = sine.iter().map(|&tau| if tau > 10.0 { tau - 20.0 } else { tau }).collect();
        let piece = TorquePiece { first_s: 3.0, rate_hz: 100.0, tau: vec![tau, sine] };
        let own = OverflowSettings::default();
        // The sine is above 10/12 from 0.985 to 2.156 rad and one period later.
        let found = jumps(&piece, 0, [-12.0, 10.0], &own);
        let at: Vec<usize> = found.iter().map(|(at, _)| *at).collect();
        assert_eq!(at, [99, 216, 727, 844], "{found:?}");
        assert!(found.iter().all(|(_, size)| (size.abs() - 20.0).abs() < 0.2), "{found:?}");
        assert!(jumps(&piece, 1, [-12.0, 12.0], &own).is_empty());
    }
}
