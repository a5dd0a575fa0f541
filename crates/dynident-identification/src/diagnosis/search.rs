//! The search for the hypothesis that explains the samples best.
//!
//! The fit without physical limits, which is ten times cheaper, bounds the score of every candidate from below: a
//! candidate that cannot win is never fitted with limits. A hypothesis is better only by a clear margin, and those that
//! come close to the best are named with it.

use super::hypothesis::{CLEARLY_BETTER, CorrectedStudy, Explained, Hypothesis, INDISTINGUISHABLE};
use super::mistakes::{Breadth, Mistake};
use super::refinement::refined;
use super::round::Round;
use crate::consistent::ConsistencySettings;

/// Number of other hypotheses from which a second mistake is searched, once the best one has a second mistake.
const MAX_RUNNERS_UP: usize = 8;
/// Mistakes of one study.
const MAX_MISTAKES: usize = 3;
/// Other hypotheses that are named.
const MAX_NAMED: usize = 4;

/// Result of the search.
#[derive(Clone, Debug)]
pub struct Search {
    /// The study as it is.
    pub as_written: Hypothesis,
    /// The hypothesis that explains the samples clearly better, if one was found.
    pub best: Option<Hypothesis>,
    /// Hypotheses that the logs do not distinguish from the best.
    pub alike: Vec<Hypothesis>,
    /// Candidates tried.
    pub tried: usize,
}

impl Search {
    /// The better hypothesis, if there is one, or the study as it is.
    pub fn believed(&self) -> &Hypothesis {
        self.best.as_ref().unwrap_or(&self.as_written)
    }

    /// The study with the mistakes of the believed hypothesis corrected.
    pub(super) fn corrected(&self, study: &CorrectedStudy) -> CorrectedStudy {
        study.without_all(&self.believed().mistakes)
    }
}

/// Searches mistakes in addition to those of `start` in a study whose evidence is `as_written`: first only common ones,
/// then common and rarer ones.
pub(super) fn searches(as_written: &Hypothesis, start: &Explained, consistency: &ConsistencySettings) -> [Search; 2] {
    let mut known = Round::default();
    [&[Breadth::Usual][..], &[Breadth::Usual, Breadth::Rare]].map(|breadths| {
        let round = |at: &Explained, known: &Round| Round::new(at, consistency, breadths, known);
        known = round(start, &known);
        search(as_written, start, known.clone(), |at| round(at, &Round::default()), consistency)
    })
}

/// Corrects up to [`MAX_MISTAKES`] mistakes one after the other, beginning with the round `first` of candidates behind
/// `start`; `next` tries the candidates behind another hypothesis.
fn search(
    as_written: &Hypothesis,
    start: &Explained,
    first: Round,
    next: impl Fn(&Explained) -> Round,
    consistency: &ConsistencySettings,
) -> Search {
    let made = start.study.mistakes.len();
    let mut at = start.clone();
    let (mut alike, mut tried): (Vec<Hypothesis>, usize) = (Vec::new(), 0);
    let mut runners_up: Vec<Explained> = Vec::new();
    let mut known = Some(first);
    for number in 0..MAX_MISTAKES {
        let round = known.take().unwrap_or_else(|| next(&at));
        tried += round.tried;
        let winners = round.winners(&at, consistency);
        let Some((first, rest)) = winners.split_first() else { break };
        // A second mistake is rarer than the first.
        if first.hypothesis.score() > at.hypothesis.score() - CLEARLY_BETTER * (made + number + 1) as f64 {
            break;
        }
        // Runners-up may have the same second mistake behind them: the first one was chosen with the second still made,
        // so the best pair counts.
        let mut first = first.clone();
        if number == 1 {
            for start in &runners_up {
                let round = next(start);
                tried += round.tried;
                let best = round.winners(start, consistency).into_iter().next();
                first = best.filter(|pair| pair.hypothesis.score() < first.hypothesis.score()).unwrap_or(first);
            }
        } else {
            runners_up = different_from(&first, rest);
        }
        let from = before_last(&first, &at.study, &runners_up);
        let best = refined(from, &first, consistency).unwrap_or(first);
        alike = indistinguishable(&best.hypothesis, rest);
        at = best;
    }
    // With few instants a small improvement is not significant.
    let best = at.hypothesis;
    let needed = as_written.margin * CLEARLY_BETTER * best.mistakes.len() as f64;
    let is_enough = as_written.margin <= 1.0 || best.score() <= as_written.score() - needed;
    let found = !best.mistakes.is_empty() && is_enough;
    Search { as_written: as_written.clone(), best: found.then_some(best), alike, tried }
}

/// Hypotheses with the same first mistakes as `best` that the logs do not distinguish from it.
fn indistinguishable(best: &Hypothesis, others: &[Explained]) -> Vec<Hypothesis> {
    let Some((last, before)) = best.mistakes.split_last() else { return Vec::new() };
    let is_close = |other: &&Hypothesis| {
        let of_other = other.mistakes.last();
        let is_twin = of_other.and_then(Mistake::twin).as_ref() == Some(last);
        let margin = if is_twin { CLEARLY_BETTER } else { INDISTINGUISHABLE };
        // The same with another number is no other explanation.
        let is_same = of_other.is_some_and(|other| other.is_alike(last));
        other.mistakes[..before.len()] == *before && !is_same && other.score() < best.score() + margin
    };
    others.iter().map(|other| &other.hypothesis).filter(is_close).take(MAX_NAMED).cloned().collect()
}

/// The best hypotheses beside `first`, one for each mistake without its number.
fn different_from(first: &Explained, others: &[Explained]) -> Vec<Explained> {
    let mut kept: Vec<Explained> = Vec::new();
    for other in others {
        let is_alike = |one: &Explained| {
            let last = one.study.mistakes.last().zip(other.study.mistakes.last());
            last.is_some_and(|(one, other)| one.is_alike(other))
        };
        if kept.len() < MAX_RUNNERS_UP && !is_alike(first) && !kept.iter().any(is_alike) {
            kept.push(other.clone());
        }
    }
    kept
}

/// The study before the correction of the last mistake.
fn before_last<'a>(reached: &Explained, at: &'a CorrectedStudy, others: &'a [Explained]) -> &'a CorrectedStudy {
    let before = &reached.study.mistakes[..reached.study.mistakes.len().saturating_sub(1)];
    let other = others.iter().find(|other| other.study.mistakes == before && at.mistakes != before);
    other.map_or(at, |other| &other.study)
}
