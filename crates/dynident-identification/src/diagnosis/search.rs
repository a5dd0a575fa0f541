//! The search for the reading that explains the samples best.
//!
//! Every candidate is bounded from below by the fit without physical limits, which is ten times cheaper: what cannot
//! win is never fitted with them. A reading counts as better only by a clear margin, and those that come close to the
//! best are named beside it.

use super::candidates::candidates;
use super::mistake::{Channels, Mistake};
use super::reading::{Corrected, Reading};
use crate::consistent::ConsistencySettings;
use dynident_estimation::EstimationError;
use rayon::prelude::*;

/// By how much a reading must score better before the study is doubted: as if one joint had less than 0.55 of what was
/// left of its torque. On seven sets of real logs the best wrong reading gains 0.41.
pub(super) const CLEARLY_BETTER: f64 = 0.6;
/// Times what the study as written leaves of all torque that a better reading may leave.
const NO_WORSE: f64 = 1.05;
/// Times what was left of a joint's torque, and a share of it, that a better reading may leave; more only where its
/// logarithm is a small share of what all joints gain together.
const SACRIFICED: f64 = 1.25;
const LITTLE: f64 = 0.02;
const SHARE_OF_GAIN: f64 = 0.1;
/// Readings this close to the best cannot be told from it.
const ALIKE: f64 = 0.2;
/// By how much a number between those tried must be better than the nearest of these: as much as a mistake.
const WORTH_REFINING: f64 = CLEARLY_BETTER;
/// Readings beside the best from which a second mistake is looked for, once there is one.
const RUNNERS_UP: usize = 3;
/// Mistakes of one study.
const MOST_MISTAKES: usize = 3;
/// Other readings that are named.
const MOST_ALIKE: usize = 4;

/// What the search found.
#[derive(Clone, Debug)]
pub struct Search {
    /// The study as it is.
    pub as_written: Reading,
    /// The reading that explains the samples clearly better; none where there is none.
    pub best: Option<Reading>,
    /// Readings that cannot be told from the best.
    pub alike: Vec<Reading>,
    /// Candidates tried.
    pub tried: usize,
}

impl Search {
    /// The better reading, where there is one, or the study as it is.
    pub fn believed(&self) -> &Reading {
        self.best.as_ref().unwrap_or(&self.as_written)
    }
}

/// A consistent robot to the accuracy that a comparison of readings needs: a hundredth of its score.
pub(super) fn rough_consistency(settings: Option<&ConsistencySettings>) -> ConsistencySettings {
    let known = settings.cloned().unwrap_or_default();
    ConsistencySettings { tolerance: 1e-2, max_iterations: 100, ..known }
}

/// Looks for mistakes behind `start`.
pub(super) fn search(start: Corrected, consistency: &ConsistencySettings) -> Result<Search, EstimationError> {
    let as_written = start.reading(Some(consistency))?;
    let (mut at, mut best) = (start, as_written.clone());
    let (mut alike, mut tried): (Vec<Reading>, usize) = (Vec::new(), 0);
    let mut runners_up: Vec<(Corrected, Reading)> = Vec::new();
    for round in 0..MOST_MISTAKES {
        let (fitted, count) = one_round(&at, &best, consistency);
        tried += count;
        let Some((first, rest)) = fitted.split_first() else { break };
        // A second mistake is rarer than the first.
        if first.1.score() > best.score() - CLEARLY_BETTER * (round + 1) as f64 {
            break;
        }
        // What a second mistake is found behind, others may be found behind as well: the pair that explains most
        // counts, for the first one was chosen with the other still made.
        let mut first = first.clone();
        if round == 1 {
            for (start, reading) in &runners_up {
                let (further, count) = one_round(start, reading, consistency);
                tried += count;
                if let Some(pair) = further.into_iter().next().filter(|pair| pair.1.score() < first.1.score()) {
                    first = pair;
                }
            }
        } else {
            runners_up = rest.iter().take(RUNNERS_UP).cloned().collect();
        }
        let start = before_last(&first, &at, &runners_up);
        let (corrected, reading) = refined(&start, &first, consistency).unwrap_or_else(|| first.clone());
        // Beside the last mistake only: what was corrected before it is the same.
        let before = reading.mistakes.len() - 1;
        let close = |(_, other): &&(Corrected, Reading)| {
            other.mistakes[..before] == reading.mistakes[..before] && other.score() < reading.score() + ALIKE
        };
        alike = rest.iter().filter(close).take(MOST_ALIKE).map(|(_, other)| other.clone()).collect();
        (at, best) = (corrected, reading);
    }
    let found = !best.mistakes.is_empty();
    Ok(Search { as_written, best: found.then_some(best), alike, tried })
}

/// Where the last mistake of a reading was corrected from.
fn before_last(reached: &(Corrected, Reading), at: &Corrected, others: &[(Corrected, Reading)]) -> Corrected {
    let before = &reached.0.mistakes[..reached.0.mistakes.len().saturating_sub(1)];
    let other = others.iter().find(|(other, _)| other.mistakes == before && at.mistakes != before);
    other.map_or_else(|| at.clone(), |(other, _)| other.clone())
}

/// The readings with one more mistake corrected that can win, best first, and how many were tried.
fn one_round(at: &Corrected, best: &Reading, consistency: &ConsistencySettings) -> (Vec<(Corrected, Reading)>, usize) {
    let is_new = |mistake: &Mistake| !at.mistakes.contains(mistake);
    let all: Vec<Mistake> = candidates(&at.robot, &at.rows).into_iter().filter(is_new).collect();
    let bounded = |mistake: &Mistake| {
        let corrected = at.without(mistake);
        let bound = corrected.reading(None).ok()?.lower_bound();
        (bound <= best.score() - CLEARLY_BETTER).then_some((bound, corrected))
    };
    let mut left: Vec<(f64, Corrected)> = all.par_iter().filter_map(bounded).collect();
    left.sort_by(|a, b| a.0.total_cmp(&b.0));
    // In batches of fixed size, so that the answer is the same for any number of threads.
    let mut fitted: Vec<(Corrected, Reading)> = Vec::new();
    let mut least = f64::INFINITY;
    for batch in left.chunks(4) {
        if batch[0].0 > least + ALIKE {
            break;
        }
        let fit = |(_, corrected): &(f64, Corrected)| {
            corrected.reading(Some(consistency)).ok().map(|reading| (corrected.clone(), reading))
        };
        fitted.extend(batch.par_iter().filter_map(fit).collect::<Vec<_>>());
        least = fitted.iter().map(|(_, reading)| reading.score()).fold(least, f64::min);
    }
    // What explains a weak joint at the cost of the strong ones explains the wrong thing.
    fitted.retain(|(_, reading)| reading.left_of_all <= NO_WORSE * best.left_of_all && !sacrifices(reading, best));
    fitted.sort_by(|a, b| a.1.score().total_cmp(&b.1.score()));
    likelier_sign_first(&mut fitted);
    (fitted, all.len())
}

/// A negative torque and a negative position of the same joints are one robot and its mirror image, which logs seldom
/// tell apart: the torque's sign, which no description fixes, is the likelier mistake.
fn likelier_sign_first(fitted: &mut [(Corrected, Reading)]) {
    let of_sign = |reading: &Reading| match reading.mistakes.last() {
        Some(Mistake::Sign { joints, channels }) => Some((joints.clone(), *channels)),
        _ => None,
    };
    let Some((_, least)) = fitted.first() else { return };
    let (Some((joints, _)), limit) = (of_sign(least), least.score() + ALIKE) else { return };
    let torque = Some((joints, Channels::Torque));
    let found = fitted.iter().position(|(_, reading)| of_sign(reading) == torque && reading.score() < limit);
    if let Some(found) = found {
        fitted[..=found].rotate_right(1);
    }
}

/// Whether a reading leaves clearly more of some joint's torque than the one it was made from.
fn sacrifices(reading: &Reading, from: &Reading) -> bool {
    let last = reading.mistakes.last();
    let gain = (from.consistent_score - reading.consistent_score).max(0.0);
    let factor = SACRIFICED.max((SHARE_OF_GAIN * gain).exp());
    (0..reading.left.len()).any(|joint| {
        let before = last.map_or(joint, |mistake| mistake.torque_from(joint));
        reading.left[joint] > factor * from.left[before] + LITTLE
    })
}

/// A zero or a mounting that lies between those tried.
fn refined(
    at: &Corrected,
    first: &(Corrected, Reading),
    consistency: &ConsistencySettings,
) -> Option<(Corrected, Reading)> {
    let free =
        |mistake: &Mistake| at.without(mistake).reading(None).map_or(f64::INFINITY, |reading| reading.lower_bound());
    let mistake = match first.1.mistakes.last()? {
        Mistake::Offset { joint, offset_rad } => {
            let at = |offset_rad: f64| Mistake::Offset { joint: *joint, offset_rad };
            let best = least_in(*offset_rad, 0.5, |offset| free(&at(offset)));
            at(best)
        }
        Mistake::Gravity { gravity_m_s2 } => {
            let mut gravity = *gravity_m_s2;
            // Turned about two axes across it, twice over.
            for round in 0..2 {
                for axis in across(gravity) {
                    let start = gravity;
                    let reach = if round == 0 { 0.5 } else { 0.1 };
                    let turn = least_in(0.0, reach, |angle| {
                        free(&Mistake::Gravity { gravity_m_s2: turned(start, axis, angle) })
                    });
                    gravity = turned(start, axis, turn);
                }
            }
            Mistake::Gravity { gravity_m_s2: gravity }
        }
        Mistake::PositionUnit { factor } => {
            // A gear ratio may be near a unit.
            let scaled = |log: f64| Mistake::PositionUnit { factor: factor * log.exp() };
            let log = least_in(0.0, 2.0, |log| free(&scaled(log)));
            if log.abs() < 0.1 {
                return None;
            }
            scaled(log)
        }
        Mistake::Sign { .. } | Mistake::Order { .. } | Mistake::TimeUnit { .. } => return None,
    };
    let corrected = at.without(&mistake);
    let reading = corrected.reading(Some(consistency)).ok()?;
    // Free numbers follow the noise: the round one stays unless the exact one is clearly better.
    (reading.score() < first.1.score() - WORTH_REFINING).then_some((corrected, reading))
}

/// Where `value` is least within `reach` of `centre`, by thirds, to a hundredth of the reach.
fn least_in(centre: f64, reach: f64, value: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (centre - reach, centre + reach);
    while high - low > 0.02 * reach {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if value(a) < value(b) {
            high = b;
        } else {
            low = a;
        }
    }
    0.5 * (low + high)
}

/// Two unit vectors across `v`.
fn across(v: [f64; 3]) -> [[f64; 3]; 2] {
    let least = (0..3).min_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0);
    let mut other = [0.0; 3];
    other[least] = 1.0;
    let first = unit(cross(v, other));
    [first, unit(cross(v, first))]
}

/// `v` turned about the unit vector `axis`, across it, by `angle` rad.
fn turned(v: [f64; 3], axis: [f64; 3], angle: f64) -> [f64; 3] {
    let side = cross(axis, v);
    core::array::from_fn(|k| v[k] * angle.cos() + side[k] * angle.sin())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / length)
}
