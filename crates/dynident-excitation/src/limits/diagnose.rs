//! Why nothing feasible was found: which limits bind, where, and the smallest relaxation that would do.

use super::combined::smallest_combination;
use super::kind::{Constraint, LimitKind};
use super::relaxation::{
    BrokenLimit, LARGEST_STRETCH, LimitChange, Relaxation, TOLERANCE, broken_limits, change, stretched,
};
use super::set::LimitSet;
use crate::motion::Motion;

/// What stands between a motion and its limits.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// Broken limits, worst first; empty for a feasible motion.
    pub broken: Vec<BrokenLimit>,
    /// Single changes that would do, the smallest first (by relative change). Where limits of several kinds are broken
    /// that no slower run fixes, the smallest combination instead; empty only where the motion is not finite, or the
    /// search for changes was stopped.
    pub relaxations: Vec<Relaxation>,
}

/// A row of a [`LimitSet`] and how much wider it must be, in its constraint's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Widened {
    pub(crate) row: usize,
    pub(crate) by: f64,
}

/// The change of limits that such widenings, all of one kind, come to; none without any.
pub(crate) fn relaxation(set: &LimitSet, widened: &[Widened]) -> Option<Relaxation> {
    let kind = set.constraints().get(widened.first()?.row)?.kind;
    let broken = widened.iter().map(|widened| BrokenLimit {
        constraint: set.constraints()[widened.row].clone(),
        value: widened.by,
        at_s: 0.0,
    });
    let changes = broken.map(|broken| change(&broken)).collect();
    Some(Relaxation::OtherMotion { kind, changes })
}

/// Looks at a motion on a dense grid of times (1 kHz or so) that includes both ends.
///
/// Running the same path slower by a factor s divides velocity by s, acceleration by s² and jerk by s³, and leaves of
/// the torque gravity as it is; the smallest s is found by bisection on the constraint values themselves. Gravity alone
/// above a torque limit, or a broken position, place or distance, cannot be fixed so.
///
/// # Panics
/// If there is not one time per sample.
pub fn diagnose(set: &LimitSet, times_s: &[f64], motion: &Motion) -> Diagnosis {
    diagnose_until(set, times_s, motion, &|| false)
}

/// [`diagnose()`] that looks for no further change once `stop` says so: the broken limits are named, and the changes
/// found until then.
///
/// # Panics
/// If there is not one time per sample.
pub fn diagnose_until(set: &LimitSet, times_s: &[f64], motion: &Motion, stop: &dyn Fn() -> bool) -> Diagnosis {
    assert_eq!(times_s.len(), motion.samples, "one time per sample");
    let broken = broken_limits(set, &mut set.workspace(), times_s, motion);
    let mut sized = Vec::new();
    if let Some(first) = broken.first().map(|first| first.constraint.kind) {
        if broken.iter().all(|broken| broken.constraint.kind == first && broken.value.is_finite()) {
            let changes = broken.iter().map(change).collect();
            sized.push((broken[0].value, Relaxation::Limits { kind: first, changes }));
        }
        let duration_s = times_s.last().zip(times_s.first()).map_or(0.0, |(last, first)| last - first);
        if let Some(factor) = smallest_stretch(set, motion, stop) {
            sized.push((factor - 1.0, Relaxation::Stretch { factor, duration_s: duration_s * factor }));
        }
    }
    sized.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut relaxations: Vec<Relaxation> = sized.into_iter().map(|(_, relaxation)| relaxation).collect();
    if relaxations.is_empty() && !broken.is_empty() {
        relaxations.extend(smallest_combination(set, times_s, motion, stop));
    }
    Diagnosis { broken, relaxations }
}

/// The smallest factor at which the stretched motion keeps every limit, rounded up in its ninth digit; `None` if none
/// up to 1000 does, or `stop` says so.
fn smallest_stretch(set: &LimitSet, motion: &Motion, stop: &dyn Fn() -> bool) -> Option<f64> {
    let mut workspace = set.workspace();
    let mut values = Vec::new();
    let mut holds = |factor: f64| {
        set.values(&mut workspace, &stretched(motion, factor), &mut values);
        values.iter().all(|c| *c <= TOLERANCE)
    };
    if stop() || !holds(LARGEST_STRETCH) {
        return None;
    }
    let (mut broken, mut kept) = (1.0, LARGEST_STRETCH);
    while kept - broken > 1e-9 * kept {
        if stop() {
            return None;
        }
        // Geometric steps: factors near 1 are the common case.
        let middle = f64::sqrt(broken * kept);
        if holds(middle) { kept = middle } else { broken = middle }
    }
    Some(kept)
}

/// How far a value is over its limit, in words.
pub(super) fn amount(constraint: &Constraint, c: f64) -> String {
    let Constraint { kind, middle, size, unit, .. } = constraint;
    let found = constraint.quantity(c);
    match kind {
        LimitKind::Position | LimitKind::Box => {
            format!("{found:.4} {unit} from the middle {middle:.4} of a range that allows {size:.4}")
        }
        LimitKind::Floor => format!("{found:.4} {unit} high where at least {middle:.4} is asked for"),
        LimitKind::SelfCollision if found <= 0.0 => {
            format!("the two overlap where at least {middle:.4} {unit} between them is asked for")
        }
        LimitKind::SelfCollision => format!("{found:.4} {unit} apart where at least {middle:.4} is asked for"),
        LimitKind::Column => format!("{found:.4} {unit} apart where at least {size:.4} is asked for"),
        _ => format!("{found:.4} {unit} where {size:.4} is allowed"),
    }
}

impl Diagnosis {
    /// Takes in changes of a single limit that a search found: they stand before combinations, which are then needless.
    pub fn take_single(&mut self, found: Vec<Relaxation>) {
        if !found.is_empty() {
            self.relaxations.retain(|known| !matches!(known, Relaxation::Combined { .. }));
            self.relaxations.extend(found);
        }
    }

    /// The diagnosis in sentences: one per broken limit, then the relaxations, or that there is no single one.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences: Vec<String> = self
            .broken
            .iter()
            .map(|BrokenLimit { constraint, value, at_s }| {
                let Constraint { kind, subject, .. } = constraint;
                format!("The {kind} limit of `{subject}` is broken at {at_s:.3} s: {}.", amount(constraint, *value))
            })
            .collect();
        for relaxation in &self.relaxations {
            sentences.push(match relaxation {
                Relaxation::Stretch { factor, duration_s } => {
                    format!(
                        "The same path would do if run {} times as long, in {duration_s:.3} s.",
                        factor_in_words(*factor)
                    )
                }
                Relaxation::Limits { kind, changes } => {
                    let changes: Vec<String> = changes.iter().map(|changed| in_words(*kind, changed)).collect();
                    format!("It would do to relax {kind} alone: {}.", changes.join(", "))
                }
                Relaxation::OtherMotion { kind, changes } => {
                    let changes: Vec<String> = changes.iter().map(|changed| in_words(*kind, changed)).collect();
                    format!(
                        "It would do to relax {kind} alone, for another motion: {} (the smallest found).",
                        changes.join(", ")
                    )
                }
                Relaxation::Combined { factor, duration_s, changes } => {
                    let mut parts = Vec::new();
                    if *factor > 1.0 {
                        let times = factor_in_words(*factor);
                        parts.push(format!("run the same path {times} times as long, in {duration_s:.3} s"));
                    }
                    parts.extend(changes.iter().map(|(kind, changed)| format!("{kind}: {}", in_words(*kind, changed))));
                    format!(
                        "No single change was found that would do. The smallest together, by the sum of their shares: {}.",
                        parts.join("; ")
                    )
                }
            });
        }
        let is_finite = self.broken.iter().all(|broken| broken.value.is_finite());
        if !is_finite && self.relaxations.is_empty() {
            sentences.push("No change would do: the motion is not finite.".to_owned());
        }
        sentences
    }
}

/// A factor above 1 with four decimals, which must not read 1.
fn factor_in_words(factor: f64) -> String {
    format!("{:.4}", factor.max(1.0001))
}

/// One limit's change, with its factor where the limit is a magnitude.
fn in_words(kind: LimitKind, change: &LimitChange) -> String {
    let (subject, now, needed, unit) = change;
    let what = match kind {
        LimitKind::Position | LimitKind::Box => "half range",
        LimitKind::Floor => return format!("`{subject}` height {needed:.4} {unit} instead of {now:.4}"),
        LimitKind::SelfCollision if *needed <= 0.0 => {
            return format!("`{subject}` would have to touch (clearance {now:.4} {unit})");
        }
        LimitKind::SelfCollision => return format!("`{subject}` clearance {needed:.4} {unit} instead of {now:.4}"),
        LimitKind::Column => "distance",
        _ => "limit",
    };
    format!("`{subject}` {what} {needed:.4} {unit} instead of {now:.4} (times {:.3})", needed / now)
}
