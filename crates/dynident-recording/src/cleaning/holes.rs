//! Interpolation of holes (missing rows) that are short compared with the motion; the filled rows are marked.

use crate::clock::timeline::Places;
use crate::log::RawBlock;

const DEGREE: usize = 5;
/// Minimum and maximum number of rows on either side that are used to fill a hole.
const MIN_SIDE_ROWS: usize = 6;
pub(super) const MAX_SIDE_ROWS: usize = 64;

/// Values at `places` of the least-squares polynomial of degree 5 through `values` at `known`.
///
/// The basis functions are orthonormal over `known`, by two Gram-Schmidt passes on the powers; they are also evaluated
/// at `places`.
fn polynomial(known: &[f64], values: &[f64], places: &[f64]) -> Vec<f64> {
    let count = known.len();
    let middle = 0.5 * (known[0] + known[count - 1]);
    let half = (0.5 * (known[count - 1] - known[0])).max(1.0);
    let x: Vec<f64> = known.iter().chain(places).map(|place| (place - middle) / half).collect();
    let origin = values[0];
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(DEGREE + 1);
    let mut out = vec![origin; places.len()];
    for k in 0..=DEGREE {
        let mut next: Vec<f64> = match k.checked_sub(1) {
            None => vec![1.0; x.len()],
            Some(before) => x.iter().zip(&basis[before]).map(|(x, p)| x * p).collect(),
        };
        for _ in 0..2 {
            for known in &basis {
                let share: f64 = known[..count].iter().zip(&next[..count]).map(|(a, b)| a * b).sum();
                next.iter_mut().zip(known).for_each(|(next, known)| *next -= share * known);
            }
        }
        let norm = next[..count].iter().map(|p| p * p).sum::<f64>().sqrt();
        for p in &mut next {
            *p /= norm;
        }
        let share: f64 = next[..count].iter().zip(values).map(|(p, value)| p * (value - origin)).sum();
        for (out, p) in out.iter_mut().zip(&next[count..]) {
            *out += share * p;
        }
        basis.push(next);
    }
    out
}

#[derive(Clone, Debug, Default)]
pub(super) struct PastRows {
    pub(super) raw: RawBlock,
    pub(super) places: Places,
}

/// Channels of a block, joint by joint: positions, torques, velocities, accelerations, temperatures.
fn channels(block: &RawBlock) -> impl Iterator<Item = &Vec<f64>> {
    block.q.iter().chain(&block.tau).chain(&block.dq).chain(&block.ddq).chain(&block.temperature_c)
}

fn channels_mut(block: &mut RawBlock) -> impl Iterator<Item = &mut Vec<f64>> {
    let RawBlock { q, tau, dq, ddq, temperature_c, .. } = block;
    q.iter_mut().chain(tau).chain(dq).chain(ddq).chain(temperature_c)
}

fn append(to: &mut RawBlock, from: &RawBlock, rows: core::ops::Range<usize>) {
    to.row.extend_from_slice(&from.row[rows.clone()]);
    to.time_s.extend_from_slice(&from.time_s[rows.clone()]);
    for (to, from) in channels_mut(to).zip(channels(from)) {
        to.extend_from_slice(&from[rows.clone()]);
    }
}

fn empty_like(block: &RawBlock) -> RawBlock {
    let none = |channels: &[Vec<f64>]| vec![Vec::new(); channels.len()];
    RawBlock {
        row: Vec::new(),
        time_s: Vec::new(),
        q: none(&block.q),
        dq: none(&block.dq),
        ddq: none(&block.ddq),
        tau: none(&block.tau),
        temperature_c: none(&block.temperature_c),
        // For a log with torque, the motion does not use commands.
        command: Vec::new(),
    }
}

/// A block with its holes filled; `missing` are the indices of the rows that were not measured.
pub(super) struct Filled {
    pub(super) raw: RawBlock,
    pub(super) places: Places,
    pub(super) missing: Vec<usize>,
    /// For each row of the original block, its index in this block.
    pub(super) new_index: Vec<usize>,
}

/// Fills the holes of a block: positions by one polynomial of degree 5 through the rows on either side (on each side
/// twice the number of missing rows, 6 to 64), other channels by straight lines. If there are too few rows next to a
/// hole, the hole starts a new piece instead.
pub(super) fn fill(before: &PastRows, block: &RawBlock, places: &Places, next: Option<&RawBlock>) -> Filled {
    let mut out = Filled {
        raw: empty_like(block),
        places: Places::default(),
        missing: Vec::new(),
        new_index: Vec::with_capacity(block.rows()),
    };
    let mut done = 0;
    let take = |out: &mut Filled, from: usize, to: usize| {
        let shift = out.raw.rows();
        append(&mut out.raw, block, from..to);
        out.places.steps.extend_from_slice(&places.steps[from..to]);
        out.places.begins.extend_from_slice(&places.begins[from..to]);
        out.new_index.extend(shift..shift + to - from);
    };
    for &hole in &places.holes {
        take(&mut out, done, hole);
        let shift = out.raw.rows();
        if let Some(rows) = fill_hole(before, block, places, next, hole) {
            let count = rows.raw.rows();
            append(&mut out.raw, &rows.raw, 0..count);
            out.places.steps.extend_from_slice(&rows.places.steps);
            out.places.begins.extend_from_slice(&rows.places.begins);
            out.missing.extend(shift..shift + count);
            take(&mut out, hole, hole + 1);
        } else {
            take(&mut out, hole, hole + 1);
            out.places.begins[shift] = true;
        }
        done = hole + 1;
    }
    take(&mut out, done, block.rows());
    out
}

/// The rows that fill one hole; `None` if there are too few rows next to it.
fn fill_hole(
    before: &PastRows,
    block: &RawBlock,
    places: &Places,
    next: Option<&RawBlock>,
    hole: usize,
) -> Option<PastRows> {
    let earlier = before.raw.rows();
    let joined = |k: usize| if k < earlier { (&before.raw, &before.places, k) } else { (block, places, k - earlier) };
    let step_of = |k: usize| {
        let (_, places, k) = joined(k);
        places.steps[k]
    };
    let at = earlier + hole;
    let (from, to) = (step_of(at.checked_sub(1)?), step_of(at));
    let missing = (to - from).round() as usize;
    let missing = missing.checked_sub(1).filter(|missing| *missing > 0)?;
    let wanted = (2 * missing).clamp(MIN_SIDE_ROWS, MAX_SIDE_ROWS);
    // Uninterrupted rows on either side, nearest first. After the end of the block, rows of the next block are used;
    // they are taken as evenly spaced.
    let is_seam = |k: usize| {
        let (_, places, k) = joined(k);
        places.begins[k] || places.holes.contains(&k)
    };
    let mut first = at;
    while first > 0 && at - first < wanted && (first == at || !is_seam(first)) {
        first -= 1;
    }
    let total = earlier + block.rows();
    let mut last = at + 1;
    while last < total && last - at < wanted && !is_seam(last) {
        last += 1;
    }
    let beyond = if last == total { (wanted - (last - at)).min(next.map_or(0, RawBlock::rows)) } else { 0 };
    if at - first < MIN_SIDE_ROWS || last - at + beyond < MIN_SIDE_ROWS {
        return None;
    }
    let end = step_of(total - 1);
    let known: Vec<f64> = (first..last).map(step_of).chain((1..=beyond).map(|k| end + k as f64)).collect();
    let steps: Vec<f64> = (1..=missing).map(|k| from + (to - from) * k as f64 / (missing + 1) as f64).collect();
    let mut rows = PastRows { raw: empty_like(block), ..PastRows::default() };
    let line = |a: f64, b: f64, k: usize| a + (b - a) * (k + 1) as f64 / (missing + 1) as f64;
    let (row_before, time_before) = {
        let (raw, _, k) = joined(at - 1);
        (raw.row[k], raw.time_s[k])
    };
    for k in 0..missing {
        rows.raw.row.push(row_before);
        rows.raw.time_s.push(line(time_before, block.time_s[hole], k));
    }
    rows.places = Places { steps: steps.clone(), begins: vec![false; missing], holes: Vec::new() };
    let joints = block.q.len();
    let behind = next.map(|next| channels(next).collect::<Vec<_>>());
    let earlier_channels: Vec<&Vec<f64>> = channels(&before.raw).collect();
    for (channel, (own, out)) in channels(block).zip(channels_mut(&mut rows.raw)).enumerate() {
        let value = |k: usize| if k < earlier { earlier_channels[channel][k] } else { own[k - earlier] };
        if channel < joints {
            let further = behind.iter().flat_map(|next| next[channel][..beyond].iter().copied());
            let values: Vec<f64> = (first..last).map(value).chain(further).collect();
            out.extend(polynomial(&known, &values, &steps));
        } else {
            out.extend((0..missing).map(|k| line(value(at - 1), own[hole], k)));
        }
    }
    Some(rows)
}

pub(super) fn last_rows(block: &RawBlock, places: &Places) -> PastRows {
    let from = block.rows().saturating_sub(MAX_SIDE_ROWS);
    let mut raw = empty_like(block);
    append(&mut raw, block, from..block.rows());
    let places =
        Places { steps: places.steps[from..].to_vec(), begins: places.begins[from..].to_vec(), holes: Vec::new() };
    PastRows { raw, places }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quintics_pass_over_a_hole_unchanged() {
        let quintic = |t: f64| 2.0 + t * (0.1 + t * (1e-3 - t * (1e-4 + t * (1e-6 - 1e-8 * t))));
        let known: Vec<f64> = (0..16).chain(24..40).map(f64::from).collect();
        let values: Vec<f64> = known.iter().map(|t| quintic(*t)).collect();
        let places: Vec<f64> = (16..24).map(f64::from).collect();
        for (place, value) in places.iter().zip(polynomial(&known, &values, &places)) {
            assert!((value - quintic(*place)).abs() < 1e-11, "{place}");
        }
    }
}
