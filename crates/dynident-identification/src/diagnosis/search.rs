//! The search for the hypothesis that explains the samples best.
//!
//! A fit without physical constraints is ten times cheaper than a physically consistent fit and gives a lower bound of
//! the score. The consistent fit is computed only for candidates whose bound is good enough. Hypotheses with almost the
//! same score as the best one are reported with it.

use super::hypothesis::{CorrectedStudy, Explained, Hypothesis};
use super::mistakes::{Breadth, Mistake};
use super::refinement::refined;
use super::round::Round;
use crate::consistent::ConsistencySettings;

/// Number of other first mistakes that are combined with a second mistake, after the best first mistake got a second
/// one.
const MAX_RUNNERS_UP: usize = 8;

/// Result of the search.
#[derive(Clone, Debug)]
pub struct Search {
    /// Score and residuals of the study as written.
    pub as_written: Hypothesis,
    /// The hypothesis that explains the samples clearly better, if one was found.
    pub best: Option<Hypothesis>,
    /// Hypotheses that the logs do not distinguish from the best one.
    pub alike: Vec<Hypothesis>,
    /// Number of candidates that were tried.
    pub tried: usize,
}

impl Search {
    /// The best hypothesis, or the study as written if no hypothesis is clearly better.
    pub fn believed(&self) -> &Hypothesis {
        self.best.as_ref().unwrap_or(&self.as_written)
    }

    /// The study with the mistakes of [`believed`](Self::believed) corrected.
    pub(super) fn corrected(&self, study: &CorrectedStudy) -> CorrectedStudy {
        study.without_all(&self.believed().mistakes)
    }
}

/// Searches for mistakes in addition to those of `start`: first only common mistakes, then common and rarer ones.
/// `as_written` is the evidence for the study as written.
pub(super) fn searches(as_written: &Hypothesis, start: &Explained, consistency: &ConsistencySettings) -> [Search; 2] {
    let mut known = Round::default();
    [&[Breadth::Usual][..], &[Breadth::Usual, Breadth::Rare]].map(|breadths| {
        let round = |at: &Explained, known: &Round| Round::new(at, consistency, breadths, known);
        known = round(start, &known);
        search(as_written, start, known.clone(), |at| round(at, &Round::default()), consistency)
    })
}

/// Corrects several mistakes one after the other. `first` is the round of candidates after `start`; `next` computes the
/// round of candidates after another hypothesis.
fn search(
    as_written: &Hypothesis,
    start: &Explained,
    first: Round,
    next: impl Fn(&Explained) -> Round,
    consistency: &ConsistencySettings,
) -> Search {
    let limits = &start.study.settings.score;
    let corrected = start.study.mistakes.len();
    let mut at = start.clone();
    let (mut alike, mut tried): (Vec<Hypothesis>, usize) = (Vec::new(), 0);
    let mut runners_up: Vec<Explained> = Vec::new();
    let mut known = Some(first);
    for number in 0..limits.max_mistakes {
        let round = known.take().unwrap_or_else(|| next(&at));
        tried += round.tried;
        let winners = round.winners(&at, consistency);
        let Some((first, rest)) = winners.split_first() else { break };
        // A second mistake is rarer than a single one, so it needs a larger improvement.
        if first.hypothesis.score() > at.hypothesis.score() - limits.min_gain * (corrected + number + 1) as f64 {
            break;
        }
        // The first mistake was selected before the second was corrected. Therefore other first mistakes are also
        // tried.
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
        let from = study_before_last_mistake(&first, &at.study, &runners_up);
        let best = refined(from, &first, consistency).unwrap_or(first);
        alike = indistinguishable(&best.hypothesis, rest);
        at = best;
    }
    // With few instants, a small improvement is not significant.
    let best = at.hypothesis;
    let needed = as_written.margin * limits.min_gain * best.mistakes.len() as f64;
    let is_enough = as_written.margin <= 1.0 || best.score() <= as_written.score() - needed;
    let found = !best.mistakes.is_empty() && is_enough;
    Search { as_written: as_written.clone(), best: found.then_some(best), alike, tried }
}

/// Hypotheses that the logs do not distinguish from `best`. They contain the same mistakes, except for the last one.
fn indistinguishable(best: &Hypothesis, others: &[Explained]) -> Vec<Hypothesis> {
    let Some((last, before)) = best.mistakes.split_last() else { return Vec::new() };
    let limits = &best.settings.score;
    let is_close = |other: &&Hypothesis| {
        let of_other = other.mistakes.last();
        let is_twin = of_other.and_then(Mistake::twin).as_ref() == Some(last);
        let margin = if is_twin { limits.min_gain } else { limits.max_indistinguishable };
        let is_same = of_other.is_some_and(|other| other.differs_only_in_number(last));
        other.mistakes[..before.len()] == *before && !is_same && other.score() < best.score() + margin
    };
    others.iter().map(|other| &other.hypothesis).filter(is_close).take(limits.max_reported).cloned().collect()
}

/// The best hypotheses other than `first`, one for each mistake regardless of its number.
fn different_from(first: &Explained, others: &[Explained]) -> Vec<Explained> {
    let mut kept: Vec<Explained> = Vec::new();
    for other in others {
        let is_same = |one: &Explained| {
            let last = one.study.mistakes.last().zip(other.study.mistakes.last());
            last.is_some_and(|(one, other)| one.differs_only_in_number(other))
        };
        if kept.len() < MAX_RUNNERS_UP && !is_same(first) && !kept.iter().any(is_same) {
            kept.push(other.clone());
        }
    }
    kept
}

fn study_before_last_mistake<'a>(
    reached: &Explained,
    at: &'a CorrectedStudy,
    others: &'a [Explained],
) -> &'a CorrectedStudy {
    let before = &reached.study.mistakes[..reached.study.mistakes.len().saturating_sub(1)];
    let other = others.iter().find(|other| other.study.mistakes == before && at.mistakes != before);
    other.map_or(at, |other| &other.study)
}
