//! Selects one common cause for all joints, if a single cause explains all differences.
//!
//! A log usually has a single mistake. The candidate causes are therefore compared over all joints with a relevant
//! difference. A candidate that explains each of these joints is reported if its residual is clearly smaller than
//! that of every other such candidate. If no candidate explains all joints, each joint is evaluated alone, with
//! stricter thresholds.

use super::CauseSettings;
use super::explanation::{Explanation, Fitted, TorqueCandidate};

#[derive(Clone, Debug)]
pub(super) struct Agreement {
    /// The reported candidate of each joint; `None` if the difference is not relevant or the cause is undetermined.
    pub(super) named: Vec<Option<Fitted>>,
    /// Sum over the joints of the unexplained squared difference, as a share of the squared torque.
    pub(super) left: f64,
}

pub(super) fn agreement(explanations: &[Explanation], thresholds: &CauseSettings) -> Agreement {
    let named = for_all(explanations, thresholds).unwrap_or_else(|| each_alone(explanations, thresholds));
    let left_of = |(own, named): (&Explanation, &Option<Fitted>)| {
        own.difference_share * (1.0 - named.map_or(0.0, |named| named.explained))
    };
    let left = explanations.iter().zip(&named).map(left_of).sum();
    Agreement { named, left }
}

/// A candidate that explains every joint with a relevant difference; `None` if there is none. The inner options are
/// `None` if the best candidate is not clearly better than the others.
fn for_all(explanations: &[Explanation], thresholds: &CauseSettings) -> Option<Vec<Option<Fitted>>> {
    let matters: Vec<&Explanation> = explanations.iter().filter(|own| own.matters).collect();
    let find =
        |own: &Explanation, kind: TorqueCandidate| own.candidates.iter().copied().find(|one| one.candidate == kind);
    let left = |kind: TorqueCandidate| -> Option<f64> {
        let of_joint = |own: &&Explanation| {
            let found = find(own, kind).filter(|found| found.explained >= thresholds.min_explained_share)?;
            Some(own.difference_share * (1.0 - found.explained))
        };
        matters.iter().map(of_joint).sum()
    };
    let mut kinds: Vec<(TorqueCandidate, f64)> =
        TorqueCandidate::ALL.into_iter().filter_map(|kind| Some((kind, left(kind)?))).collect();
    kinds.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (best, least) = *kinds.first()?;
    let is_clear = kinds.get(1).is_none_or(|(_, left)| *left >= thresholds.min_residual_ratio * least);
    let of = |own: &Explanation| if own.matters && is_clear { find(own, best) } else { None };
    Some(explanations.iter().map(of).collect())
}

/// A candidate for each joint with a relevant difference. There are no candidates if one joint remains undetermined,
/// because its mistake may affect all joints.
fn each_alone(explanations: &[Explanation], thresholds: &CauseSettings) -> Vec<Option<Fitted>> {
    let named: Vec<Option<Fitted>> = explanations.iter().map(|own| alone(own, thresholds)).collect();
    let is_open = explanations.iter().zip(&named).any(|(own, named)| own.matters && named.is_none());
    if is_open { vec![None; explanations.len()] } else { named }
}

/// The candidate for one joint, if it explains nearly all of the difference, and clearly more than every other
/// candidate.
fn alone(own: &Explanation, thresholds: &CauseSettings) -> Option<Fitted> {
    let best =
        *own.candidates.first().filter(|best| own.matters && best.explained >= thresholds.min_explained_share_alone)?;
    let left = |of: &Fitted| 1.0 - of.explained;
    let is_clear =
        own.candidates[1..].iter().all(|other| left(other) >= thresholds.min_residual_ratio_alone * left(&best));
    is_clear.then_some(best)
}
