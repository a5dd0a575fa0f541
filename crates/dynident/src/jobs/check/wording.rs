//! A finding, and alternatives and evidence of a mistake, in words.

use super::changes::changes;
use crate::result::CheckFinding;
use core::fmt::Write;
use dynident_identification::diagnosis::{Hypothesis, Mistake, StudyKeys};
use dynident_recording::Level;

/// Logarithm of the ratio of a joint's unexplained shares from which it is evidence.
const MIN_GAIN: f64 = 0.2;

/// A problem without keys to write.
pub(super) fn finding(kind: &str, what: String, evidence: String) -> CheckFinding {
    CheckFinding { level: Level::Problem, kind: kind.to_owned(), what, evidence, write: Vec::new(), or: Vec::new() }
}

/// Another explanation, with the keys to write.
pub(super) fn alternative(mistake: &Mistake, joints: &[String], keys: Option<&StudyKeys>) -> String {
    let write: Vec<String> =
        changes(mistake, keys).iter().map(|change| format!("[{}] {}", change.table, change.line)).collect();
    let sentence = mistake.sentence(joints);
    if write.is_empty() { sentence } else { format!("{sentence} ({})", write.join(", ")) }
}

/// The evidence of a mistake: the joint whose torque it explains most, and limits that then hold.
pub(super) fn evidence(mistake: &Mistake, before: &Hypothesis, after: &Hypothesis, joints: &[String]) -> String {
    let gain_of = |of: fn(&Hypothesis) -> &[f64], joint: usize| {
        let share = |hypothesis| of(hypothesis).get(joint).map_or(1.0, |share: &f64| share.max(1e-6));
        (share(before) / share(after)).ln()
    };
    let gain = |joint: &usize| gain_of(|hypothesis| &hypothesis.left, *joint);
    let named = mistake.joints(joints.len());
    // The named joint where its gain is large enough; otherwise the joint with the largest.
    let own = named.iter().copied().max_by(|a, b| gain(a).total_cmp(&gain(b))).filter(|joint| gain(joint) > MIN_GAIN);
    let most = (0..joints.len()).max_by(|a, b| gain(a).total_cmp(&gain(b))).unwrap_or(0);
    let joint = own.unwrap_or(most);
    // Where a consistent robot explains both alike, the described bodies are the evidence.
    let by_bodies = |joint: &usize| gain_of(|hypothesis| &hypothesis.nominal, *joint);
    let of_bodies = (0..joints.len()).max_by(|a, b| by_bodies(a).total_cmp(&by_bodies(b)));
    let are_described = before.nominal.len() == joints.len() && after.nominal.len() == joints.len();
    let of_bodies = of_bodies.filter(|joint| are_described && gain(&most) <= MIN_GAIN && by_bodies(joint) > MIN_GAIN);
    let mut text = match of_bodies {
        Some(joint) => format!(
            "the description's bodies, friction aside, leave {:.1} % of the torque of `{}` as the study is written and {:.1} % so corrected; bodies that could be explain both alike",
            100.0 * before.nominal[joint],
            joints[joint],
            100.0 * after.nominal[joint]
        ),
        None => format!(
            "the best robot that can exist leaves {:.1} % of the torque of `{}` as the study is written and {:.1} % so corrected",
            100.0 * before.left[joint],
            joints[joint],
            100.0 * after.left[joint]
        ),
    };
    if before.beyond.len() > after.beyond.len() {
        let worst = &before.beyond[0];
        let _ = write!(
            text,
            "; as written, the {} of `{}` reaches {:.4} where its limit is {:.4}",
            worst.quantity, joints[worst.joint], worst.value, worst.limit
        );
    }
    if !before.plausible_rate && after.plausible_rate {
        text += "; as written, no recorder has such a rate";
    }
    text + &after.factors_alike.map_or_else(String::new, |range| mistake.other_factors(range))
}
