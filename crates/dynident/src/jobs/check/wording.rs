//! Wording of findings, alternatives and evidence.

use super::CheckSettings;
use super::changes::changes;
use crate::result::CheckFinding;
use core::fmt::Write;
use dynident_identification::diagnosis::{Hypothesis, Mistake, StudyKeys};
use dynident_recording::Level;

/// Smallest improvement that is mentioned as evidence: natural logarithm of the ratio of a joint's unexplained torque
/// before and after the correction.
const MIN_LOG_RATIO: f64 = 0.2;

#[derive(Clone, Copy)]
pub(super) struct FindingContext<'a> {
    pub(super) joints: &'a [String],
    pub(super) keys: Option<&'a StudyKeys>,
    pub(super) thresholds: &'a CheckSettings,
}

pub(super) fn finding(kind: &str, what: String, evidence: String) -> CheckFinding {
    CheckFinding {
        level: Level::Problem,
        kind: kind.to_owned(),
        what,
        evidence,
        write: Vec::new(),
        or: Vec::new(),
        code: format!("check-{kind}"),
    }
}

pub(super) fn alternative(mistake: &Mistake, joints: &[String], keys: Option<&StudyKeys>) -> String {
    let write: Vec<String> =
        changes(mistake, keys).iter().map(|change| format!("[{}] {}", change.table, change.line)).collect();
    let sentence = mistake.sentence(joints);
    if write.is_empty() { sentence } else { format!("{sentence} ({})", write.join(", ")) }
}

/// Evidence for a mistake: the joint with the largest improvement, and limits that are kept only with the correction.
pub(super) fn evidence(mistake: &Mistake, before: &Hypothesis, after: &Hypothesis, joints: &[String]) -> String {
    let gain_of = |of: fn(&Hypothesis) -> &[f64], joint: usize| {
        let share = |hypothesis| of(hypothesis).get(joint).map_or(1.0, |share: &f64| share.max(1e-6));
        (share(before) / share(after)).ln()
    };
    let gain = |joint: &usize| gain_of(|hypothesis| &hypothesis.left, *joint);
    let named = mistake.joints(joints.len());
    // The joint that the mistake concerns is preferred if its improvement is large enough.
    let own =
        named.iter().copied().max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|joint| gain(joint) > MIN_LOG_RATIO);
    let most = (0..joints.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0);
    let joint = own.unwrap_or(most);
    // If consistent bodies explain both hypotheses equally well, the fit of the nominal bodies is the evidence.
    let by_bodies = |joint: &usize| gain_of(|hypothesis| &hypothesis.nominal, *joint);
    let of_bodies = (0..joints.len()).max_by(|a, b| by_bodies(a).total_cmp(&by_bodies(b)));
    let are_described = before.nominal.len() == joints.len() && after.nominal.len() == joints.len();
    let of_bodies =
        of_bodies.filter(|joint| are_described && gain(&most) <= MIN_LOG_RATIO && by_bodies(joint) > MIN_LOG_RATIO);
    let mut text = match of_bodies {
        Some(joint) => format!(
            "with the nominal bodies and without friction, {:.1} % of the torque of `{}` is unexplained as written and {:.1} % with the correction; the best consistent fits are equal",
            100.0 * before.nominal[joint],
            joints[joint],
            100.0 * after.nominal[joint]
        ),
        None => format!(
            "best physically consistent fit: {:.1} % of the torque of `{}` unexplained as written, {:.1} % with the correction",
            100.0 * before.left[joint],
            joints[joint],
            100.0 * after.left[joint]
        ),
    };
    if before.beyond.len() > after.beyond.len() {
        let worst = &before.beyond[0];
        let _ = write!(
            text,
            "; as written, the {} of `{}` reaches {:.4}, its limit is {:.4}",
            worst.quantity, joints[worst.joint], worst.value, worst.limit
        );
    }
    if !before.plausible_rate && after.plausible_rate {
        text += "; as written, the sample rate is implausible";
    }
    text + &after.factors_alike.map_or_else(String::new, |range| mistake.other_factors(range))
}
