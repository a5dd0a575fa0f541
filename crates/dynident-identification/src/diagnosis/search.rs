//! The search for the reading that explains the samples best.
//!
//! Every candidate is bounded from below by the fit without physical limits, which is ten times cheaper: what cannot
//! win is never fitted with them. A reading counts as better only by a clear margin, and those that come close to the
//! best are named beside it.

use super::candidates::{Breadth, FAR, candidates};
use super::joint_fits::SharedMotion;
use super::mistake::{Channels, Mistake, without_mistakes};
use super::motion_rows::MotionRows;
use super::numbers::between_those_tried;
use super::reading::{ALIKE, CLEARLY_BETTER, Corrected, Reading};
use super::refinement::refined;
use crate::consistent::ConsistencySettings;
use dynident_dynamics::ParametricModel;
use rayon::prelude::*;

/// Times what the study as written leaves of all torque that a better reading may leave.
const NO_WORSE: f64 = 1.05;
/// Times what was left of a joint's torque, and a share of it, that a better reading may leave; more only where its
/// logarithm is a small share of what all joints gain together.
const SACRIFICED: f64 = 1.25;
const LITTLE: f64 = 0.02;
const SHARE_OF_GAIN: f64 = 0.1;
/// Readings beside the best from which a second mistake is looked for, once there is one.
const RUNNERS_UP: usize = 8;
/// Share of a joint's torque that is left where its columns say nothing.
const MOSTLY_NOISE: f64 = 0.5;
/// Times what was left of a joint's torque that its right unit leaves.
const EXPLAINS: f64 = 0.8;
/// Times what parameters of its own leave of a joint's torque that one robot leaves where it is another's.
const STRAY: f64 = 1.8;
/// What one gain more explains of all joints' torque, as a logarithm, where no joint needs to tell: on real logs a
/// wrong one reaches 0.83.
const GAINS_MUCH: f64 = 2.0 * CLEARLY_BETTER;
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

    /// Robot and rows of the reading that is believed.
    pub(super) fn corrected(&self, robot: &ParametricModel, rows: &MotionRows) -> (ParametricModel, MotionRows) {
        without_mistakes(&self.believed().mistakes, robot, rows)
    }
}

/// A consistent robot to the accuracy that a comparison of readings needs: a hundredth of its score.
pub(super) fn rough_consistency(settings: Option<&ConsistencySettings>) -> ConsistencySettings {
    let known = settings.cloned().unwrap_or_default();
    ConsistencySettings { tolerance: 1e-2, max_iterations: 100, ..known }
}

/// Looks for mistakes behind the reading `start` of a study that reads `as_written`: for those that people often make,
/// and for rarer ones beside them.
pub(super) fn searches(
    as_written: &Reading,
    start: &(Corrected, Reading),
    consistency: &ConsistencySettings,
) -> [Search; 2] {
    let usual = Round::new((&start.0, &start.1), consistency, Breadth::Usual, &Round::default());
    let all = Round::new((&start.0, &start.1), consistency, Breadth::All, &usual);
    [(usual, Breadth::Usual), (all, Breadth::All)]
        .map(|(first, breadth)| search(as_written.clone(), start.clone(), first, consistency, breadth))
}

/// Goes on from the round `first` of one more mistake behind `start`, as far as `breadth` says.
fn search(
    as_written: Reading,
    start: (Corrected, Reading),
    first: Round,
    consistency: &ConsistencySettings,
    breadth: Breadth,
) -> Search {
    let made = start.0.mistakes.len();
    let (mut at, mut best) = start;
    let (mut alike, mut tried): (Vec<Reading>, usize) = (Vec::new(), 0);
    let mut runners_up: Vec<(Corrected, Reading)> = Vec::new();
    let mut first = Some(first);
    for round in 0..MOST_MISTAKES {
        let next = || Round::new((&at, &best), consistency, breadth, &Round::default());
        let of_round = first.take().unwrap_or_else(next);
        tried += of_round.tried;
        let fitted = of_round.winners((&at, &best), consistency);
        let Some((first, rest)) = fitted.split_first() else { break };
        // A second mistake is rarer than the first.
        if first.1.score() > best.score() - CLEARLY_BETTER * (made + round + 1) as f64 {
            break;
        }
        // What a second mistake is found behind, others may be found behind as well: the pair that explains most
        // counts, for the first one was chosen with the other still made.
        let mut first = first.clone();
        if round == 1 {
            for (start, reading) in &runners_up {
                let further = Round::new((start, reading), consistency, breadth, &Round::default());
                tried += further.tried;
                let winners = further.winners((start, reading), consistency);
                if let Some(pair) = winners.into_iter().next().filter(|pair| pair.1.score() < first.1.score()) {
                    first = pair;
                }
            }
        } else {
            runners_up = unlike_ones(&first, rest);
        }
        let start = before_last(&first, &at, &runners_up);
        let (corrected, reading) = refined(&start, &first, consistency).unwrap_or_else(|| first.clone());
        // Beside the last mistake only: what was corrected before it is the same.
        let before = reading.mistakes.len() - 1;
        let close = |(_, other): &&(Corrected, Reading)| {
            let margin = if are_twins(other, &reading) { CLEARLY_BETTER } else { ALIKE };
            let last = |reading: &Reading| reading.mistakes.last().cloned();
            // The same with another number is no other explanation.
            let is_the_same = last(other).zip(last(&reading)).is_some_and(|(a, b)| a.is_alike(&b));
            let begins_alike = other.mistakes[..before] == reading.mistakes[..before];
            begins_alike && !is_the_same && other.score() < reading.score() + margin
        };
        alike = rest.iter().filter(close).take(MOST_ALIKE).map(|(_, other)| other.clone()).collect();
        (at, best) = (corrected, reading);
    }
    // Of few instants a reading that is a little better says nothing.
    let has_to_gain = as_written.margin * CLEARLY_BETTER * best.mistakes.len() as f64;
    let found =
        !best.mistakes.is_empty() && (as_written.margin <= 1.0 || best.score() <= as_written.score() - has_to_gain);
    Search { as_written, best: found.then_some(best), alike, tried }
}

/// The best readings beside `first`, of each kind of mistake and joint one.
fn unlike_ones(first: &(Corrected, Reading), rest: &[(Corrected, Reading)]) -> Vec<(Corrected, Reading)> {
    let mut kept: Vec<(Corrected, Reading)> = Vec::new();
    for other in rest {
        let is_alike = |one: &(Corrected, Reading)| {
            let last = one.1.mistakes.last().zip(other.1.mistakes.last());
            last.is_some_and(|(one, other)| one.is_alike(other))
        };
        if kept.len() < RUNNERS_UP && !is_alike(first) && !kept.iter().any(is_alike) {
            kept.push(other.clone());
        }
    }
    kept
}

/// Where the last mistake of a reading was corrected from.
fn before_last(reached: &(Corrected, Reading), at: &Corrected, others: &[(Corrected, Reading)]) -> Corrected {
    let before = &reached.0.mistakes[..reached.0.mistakes.len().saturating_sub(1)];
    let other = others.iter().find(|(other, _)| other.mistakes == before && at.mistakes != before);
    other.map_or_else(|| at.clone(), |(other, _)| other.clone())
}

/// Readings with one more mistake corrected.
#[derive(Default)]
struct Round {
    /// How many were tried.
    tried: usize,
    /// Those that can win by what is known of them without a consistent robot, each with the least that its score can
    /// be.
    left: Vec<(f64, Corrected)>,
    /// Of these, and of gains between those tried, the ones that a consistent robot was found for.
    fitted: Vec<(Corrected, Reading)>,
}

impl Round {
    /// The readings behind the reading `best` of `at`, from what is `known` of the usual ones among them.
    fn new(
        (at, best): (&Corrected, &Reading),
        consistency: &ConsistencySettings,
        breadth: Breadth,
        known: &Self,
    ) -> Self {
        let is_new = |mistake: &Mistake| !at.mistakes.contains(mistake);
        // The usual ones stand first.
        let all: Vec<Mistake> = candidates(&at.robot, &at.rows, breadth).into_iter().filter(is_new).collect();
        let Ok(motion) = at.motion() else { return Self::default() };
        let bounded = |mistake: &Mistake| {
            let corrected = at.without(mistake);
            corrected.lower_bound_within(best.score() - CLEARLY_BETTER, &motion).map(|bound| (bound, corrected))
        };
        let mut left = known.left.clone();
        left.extend(all[known.tried..].par_iter().filter_map(bounded).collect::<Vec<_>>());
        let of_gains: Vec<_> = gains_of_torques((at, &motion), &left).par_iter().filter_map(bounded).collect();
        let mut can_win: Vec<&(f64, Corrected)> = left.iter().chain(&of_gains).collect();
        can_win.sort_by(|a, b| a.0.total_cmp(&b.0));
        // In batches of fixed size, so that the answer is the same for any number of threads.
        let mut fitted: Vec<(Corrected, Reading)> = Vec::new();
        let mut least = f64::INFINITY;
        for batch in can_win.chunks(4) {
            if batch[0].0 > least + ALIKE {
                break;
            }
            let fit = |(_, corrected): &&(f64, Corrected)| {
                let as_known = known.fitted.iter().find(|(fitted, _)| fitted.mistakes == corrected.mistakes);
                let reading = || Some((corrected.clone(), corrected.reading(Some(consistency)).ok()?));
                as_known.cloned().or_else(reading)
            };
            fitted.extend(batch.par_iter().filter_map(fit).collect::<Vec<_>>());
            least = fitted.iter().map(|(_, reading)| reading.score()).fold(least, f64::min);
        }
        Self { tried: all.len(), left, fitted }
    }

    /// Those that explain the samples without harm to any joint, best first.
    fn winners(
        mut self,
        (at, best): (&Corrected, &Reading),
        consistency: &ConsistencySettings,
    ) -> Vec<(Corrected, Reading)> {
        self.fitted.extend(twin_of_best(&self.fitted, at, consistency));
        // What explains a weak joint at the cost of the strong ones explains the wrong thing.
        self.fitted.retain(|(_, reading)| {
            reading.left_of_all <= NO_WORSE * best.left_of_all
                && !sacrifices(reading, best)
                && explains_its_joint(reading, best)
        });
        self.fitted.sort_by(|a, b| a.1.score().total_cmp(&b.1.score()));
        likelier_sign_first(&mut self.fitted);
        self.fitted
    }
}

/// Whether two readings are of the same joints, one of positions and the other of torques: what tells them apart is as
/// weak as what tells a mistake from none.
fn are_twins(a: &Reading, b: &Reading) -> bool {
    let twin = |reading: &Reading| reading.mistakes.last().and_then(twin);
    twin(a).is_some_and(|twin| b.mistakes.last() == Some(&twin))
}

/// The mistake of the same joints in the other of position and torque; none of both.
fn twin(mistake: &Mistake) -> Option<Mistake> {
    let other = |channels: &Channels| match channels {
        Channels::Position => Some(Channels::Torque),
        Channels::Torque => Some(Channels::Position),
        Channels::Both => None,
    };
    match mistake {
        Mistake::Order { order, channels } => Some(Mistake::Order { order: order.clone(), channels: other(channels)? }),
        Mistake::Sign { joints, channels } => {
            Some(Mistake::Sign { joints: joints.clone(), channels: other(channels)? })
        }
        Mistake::Offset { .. }
        | Mistake::PositionUnit { .. }
        | Mistake::TorqueUnit { .. }
        | Mistake::Coupled { .. }
        | Mistake::TimeUnit { .. }
        | Mistake::Lag { .. }
        | Mistake::Convention { .. }
        | Mistake::Length { .. }
        | Mistake::Compensated
        | Mistake::Gravity { .. } => None,
    }
}

/// Beside the best reading, its [`twin`], which explains much alike.
fn twin_of_best(
    fitted: &[(Corrected, Reading)],
    at: &Corrected,
    consistency: &ConsistencySettings,
) -> Option<(Corrected, Reading)> {
    let (best, _) = fitted.iter().min_by(|a, b| a.1.score().total_cmp(&b.1.score()))?;
    let twin = at.without(&twin(best.mistakes.last()?)?);
    let is_known = fitted.iter().any(|(fitted, _)| fitted.mistakes == twin.mistakes);
    let reading = if is_known { None } else { twin.reading(Some(consistency)).ok() };
    reading.map(|reading| (twin, reading))
}

/// For each joint whose torque some other gain explains better, the gain that does best: a joint whose torque spoils
/// the others' is not mended by one that is only nearer.
fn gains_of_torques((at, motion): (&Corrected, &SharedMotion), tried: &[(f64, Corrected)]) -> Vec<Mistake> {
    let free = |mistake: &Mistake| at.without(mistake).free_score(motion).unwrap_or(f64::INFINITY);
    let mut nearest: Vec<Option<(f64, Mistake)>> = vec![None; at.robot.dof()];
    for (_, corrected) in tried {
        let Some(mistake @ Mistake::TorqueUnit { joint, .. }) = corrected.mistakes.last() else { continue };
        let score = free(mistake);
        if nearest[*joint].as_ref().is_none_or(|(least, _)| score < *least) {
            nearest[*joint] = Some((score, mistake.clone()));
        }
    }
    let nearest: Vec<Mistake> = nearest.into_iter().flatten().map(|(_, mistake)| mistake).collect();
    nearest.par_iter().filter_map(|mistake| between_those_tried(mistake, free)).collect()
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

/// Whether a reading with another column of one joint explains that joint: a channel that says nothing, dead or noise,
/// is as good in any unit, and another gain of a torque that was explained before serves other joints' torques. Only
/// where some joint's torque did not belong to one robot with the others (the wrong gain of a strong joint spoils its
/// neighbours') and then does, is it the gain.
fn explains_its_joint(reading: &Reading, from: &Reading) -> bool {
    let (joint, has_to_gain) = match reading.mistakes.last() {
        Some(Mistake::TorqueUnit { joint, .. }) => (*joint, true),
        Some(Mistake::Coupled { joint, .. }) => (*joint, false),
        // A unit that is far too small shows by how far the joint travels.
        Some(Mistake::PositionUnit { joints, factor }) if joints.len() == 1 => (joints[0], *factor >= FAR.recip()),
        // A zero that is elsewhere shows in the torque: any does that brings a joint back between its stops, which the
        // description may have wrong as well.
        Some(Mistake::Offset { .. }) => return reading.torque_score() < from.torque_score() - ALIKE,
        // What no base parameters make up for: bodies that could not be are no other length.
        Some(Mistake::Length { .. }) => return reading.free_score < from.free_score - CLEARLY_BETTER,
        // Bodies that are described too heavy look so to the description, not to bodies that could be.
        Some(Mistake::Compensated) => {
            let score = |reading: &Reading| reading.consistent_score + reading.torque_growth;
            return score(reading) < score(from) - CLEARLY_BETTER;
        }
        _ => return true,
    };
    let left = reading.left[joint];
    let finds_its_robot = |joint: usize| {
        let finds = |[before, after]: [f64; 2]| {
            let is_stray = |left: f64, reading: &Reading| left > STRAY * reading.alone[joint];
            is_stray(before, from) && !is_stray(after, reading) && after < EXPLAINS * before
        };
        // Of one set of parameters, or of those that a robot can have.
        finds([from.free[joint], reading.free[joint]]) || finds([from.left[joint], reading.left[joint]])
    };
    let gains_much = reading.consistent_score < from.consistent_score - GAINS_MUCH;
    let gains = gains_much || left < EXPLAINS * from.left[joint] || (0..from.left.len()).any(finds_its_robot);
    left < MOSTLY_NOISE && (!has_to_gain || gains)
}

/// Whether a reading leaves clearly more of some joint's torque than the one it was made from.
fn sacrifices(reading: &Reading, from: &Reading) -> bool {
    let last = reading.mistakes.last();
    let gain = (from.score() - reading.score()).max(0.0);
    let factor = SACRIFICED.max((SHARE_OF_GAIN * gain).exp());
    (0..reading.left.len()).any(|joint| {
        let before = last.map_or(joint, |mistake| mistake.torque_from(joint));
        reading.left[joint] > factor * from.left[before] + LITTLE
    })
}
