//! One cause for all joints, where one explains them all.
//!
//! A log is usually wrong in one way. So the candidates are compared over all joints whose difference matters: one that
//! explains each of them is named, if it leaves clearly less than every other one that does. Where none explains all,
//! each joint is judged alone, by a stricter rule.

use super::explanation::{Explanation, Fitted, TorqueCandidate};

/// Share of the squared difference that a cause explains at least.
const LEAST_EXPLAINED: f64 = 0.85;
/// Minimum ratio of the squared residuals of the second-best and of the named candidate.
const CLEARLY_BETTER: f64 = 2.0;
/// The same two for a cause of a single joint beside joints with another one.
const LEAST_EXPLAINED_ALONE: f64 = 0.95;
const CLEARLY_BETTER_ALONE: f64 = 4.0;

/// What is named of each joint, and what it leaves.
#[derive(Clone, Debug)]
pub(super) struct Agreement {
    /// The candidate that is named; none where the difference does not matter or the cause is open.
    pub(super) named: Vec<Option<Fitted>>,
    /// Sum over the joints of what is left of the squared difference, as a share of the squared torque.
    pub(super) left: f64,
}

/// Names a cause for all joints, or for each.
pub(super) fn agreement(explanations: &[Explanation]) -> Agreement {
    let named = for_all(explanations).unwrap_or_else(|| each_alone(explanations));
    let left_of = |(own, named): (&Explanation, &Option<Fitted>)| {
        own.difference_share * (1.0 - named.map_or(0.0, |named| named.explained))
    };
    let left = explanations.iter().zip(&named).map(left_of).sum();
    Agreement { named, left }
}

/// A candidate that explains every joint whose difference matters; the outer option is none where there is no such
/// candidate.
fn for_all(explanations: &[Explanation]) -> Option<Vec<Option<Fitted>>> {
    let matters: Vec<&Explanation> = explanations.iter().filter(|own| own.matters).collect();
    let find =
        |own: &Explanation, kind: TorqueCandidate| own.candidates.iter().copied().find(|one| one.candidate == kind);
    let left = |kind: TorqueCandidate| -> Option<f64> {
        let of_joint = |own: &&Explanation| {
            let found = find(own, kind).filter(|found| found.explained >= LEAST_EXPLAINED)?;
            Some(own.difference_share * (1.0 - found.explained))
        };
        matters.iter().map(of_joint).sum()
    };
    let mut kinds: Vec<(TorqueCandidate, f64)> =
        TorqueCandidate::ALL.into_iter().filter_map(|kind| Some((kind, left(kind)?))).collect();
    kinds.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (best, least) = *kinds.first()?;
    let is_clear = kinds.get(1).is_none_or(|(_, left)| *left >= CLEARLY_BETTER * least);
    let of = |own: &Explanation| if own.matters && is_clear { find(own, best) } else { None };
    Some(explanations.iter().map(of).collect())
}

/// A candidate of each joint whose difference matters; none at all where one of them is open, because what is wrong
/// there may be wrong everywhere.
fn each_alone(explanations: &[Explanation]) -> Vec<Option<Fitted>> {
    let named: Vec<Option<Fitted>> = explanations.iter().map(alone).collect();
    let is_open = explanations.iter().zip(&named).any(|(own, named)| own.matters && named.is_none());
    if is_open { vec![None; explanations.len()] } else { named }
}

/// The candidate of one joint, if it explains nearly all and far more than every other.
fn alone(own: &Explanation) -> Option<Fitted> {
    let best = *own.candidates.first().filter(|best| own.matters && best.explained >= LEAST_EXPLAINED_ALONE)?;
    let left = |of: &Fitted| 1.0 - of.explained;
    let is_clear = own.candidates[1..].iter().all(|other| left(other) >= CLEARLY_BETTER_ALONE * left(&best));
    is_clear.then_some(best)
}
