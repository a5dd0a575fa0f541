//! Diagnosis of an infeasible motion: which limits are violated and where, and the smallest sufficient change of
//! limits.

use super::combined::smallest_combination;
use super::kind::{Constraint, LimitKind};
use super::relaxation::{
    BrokenLimit, LimitChange, MAX_STRETCH, Relaxation, TOLERANCE, broken_limits, change, stretched,
};
use super::set::LimitSet;
use crate::motion::Motion;

/// Violated limits of a motion, and the changes that make it feasible.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// Violated limits, largest violation first; empty for a feasible motion.
    pub broken: Vec<BrokenLimit>,
    /// Single sufficient changes, sorted by relative change. If a slower motion is not sufficient and limits of
    /// several kinds are violated, contains the smallest combination of changes instead. Empty only if the motion is
    /// not finite or the search for changes was stopped.
    pub relaxations: Vec<Relaxation>,
}

/// A row of a [`LimitSet`] and the widening that it requires, in units of the constraint's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Widened {
    pub(crate) row: usize,
    pub(crate) by: f64,
}

/// The change of limits for widenings of one kind; `None` without widenings.
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

/// Diagnoses a motion on a dense grid of times (about 1 kHz) that includes both ends.
///
/// Running the same path slower by a factor s divides velocity by s, acceleration by s² and jerk by s³; gravity
/// torque does not change. The smallest s is found by bisection on the constraint values. Slower motion cannot
/// correct a gravity torque above a limit, or a violated limit of position, place or distance.
///
/// The search for changes ends when `stop` returns true. The result then contains all violated limits and the changes
/// found so far.
///
/// # Panics
/// If the number of times differs from the number of samples.
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

/// The smallest factor at which the slowed-down motion keeps every limit, rounded up in its ninth digit; `None` if no
/// factor up to 1000 is sufficient or `stop` returns true.
fn smallest_stretch(set: &LimitSet, motion: &Motion, stop: &dyn Fn() -> bool) -> Option<f64> {
    let mut workspace = set.workspace();
    let mut values = Vec::new();
    let mut holds = |factor: f64| {
        set.values(&mut workspace, &stretched(motion, factor), &mut values);
        values.iter().all(|c| *c <= TOLERANCE)
    };
    if stop() || !holds(MAX_STRETCH) {
        return None;
    }
    let (mut broken, mut kept) = (1.0, MAX_STRETCH);
    while kept - broken > 1e-9 * kept {
        if stop() {
            return None;
        }
        // Geometric bisection, because factors near 1 are the common case.
        let middle = f64::sqrt(broken * kept);
        if holds(middle) { kept = middle } else { broken = middle }
    }
    Some(kept)
}

pub(super) fn amount(constraint: &Constraint, c: f64) -> String {
    let Constraint { kind, middle, size, unit, .. } = constraint;
    let found = constraint.quantity(c);
    match kind {
        LimitKind::Position | LimitKind::Box => {
            format!("{found:.4} {unit} from the middle {middle:.4} of the range, allowed {size:.4}")
        }
        LimitKind::Floor => format!("height {found:.4} {unit}, required at least {middle:.4}"),
        LimitKind::SelfCollision if found <= 0.0 => {
            format!("the links overlap, required distance at least {middle:.4} {unit}")
        }
        LimitKind::SelfCollision => format!("distance {found:.4} {unit}, required at least {middle:.4}"),
        LimitKind::Column => format!("distance {found:.4} {unit}, required at least {size:.4}"),
        _ => format!("{found:.4} {unit}, allowed {size:.4}"),
    }
}

impl Diagnosis {
    /// Adds single changes that a search found. Removes combinations of changes, which are then unnecessary.
    pub fn take_single(&mut self, found: Vec<Relaxation>) {
        if !found.is_empty() {
            self.relaxations.retain(|known| !matches!(known, Relaxation::Combined { .. }));
            self.relaxations.extend(found);
        }
    }

    /// The diagnosis in sentences: one for each violated limit, then the relaxations.
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences: Vec<String> = self
            .broken
            .iter()
            .map(|BrokenLimit { constraint, value, at_s }| {
                let Constraint { kind, subject, .. } = constraint;
                format!("The {kind} limit of `{subject}` is violated at {at_s:.3} s: {}.", amount(constraint, *value))
            })
            .collect();
        for relaxation in &self.relaxations {
            sentences.push(match relaxation {
                Relaxation::Stretch { factor, duration_s } => {
                    format!(
                        "The same path is feasible if it takes {} times as long, {duration_s:.3} s.",
                        formatted_factor(*factor)
                    )
                }
                Relaxation::Limits { kind, changes } => {
                    let changes: Vec<String> = changes.iter().map(|changed| described_change(*kind, changed)).collect();
                    format!("Relaxing {kind} alone is sufficient: {}.", changes.join(", "))
                }
                Relaxation::OtherMotion { kind, changes } => {
                    let changes: Vec<String> = changes.iter().map(|changed| described_change(*kind, changed)).collect();
                    format!(
                        "Relaxing {kind} alone is sufficient for another motion: {} (smallest change found).",
                        changes.join(", ")
                    )
                }
                Relaxation::Combined { factor, duration_s, changes } => {
                    let mut parts = Vec::new();
                    if *factor > 1.0 {
                        let times = formatted_factor(*factor);
                        parts.push(format!("the same path {times} times as long, in {duration_s:.3} s"));
                    }
                    parts.extend(changes.iter().map(|(kind, changed)| format!("{kind}: {}", described_change(*kind, changed))));
                    format!(
                        "No single sufficient change was found. The combination with the smallest sum of relative changes: {}.",
                        parts.join("; ")
                    )
                }
            });
        }
        let is_finite = self.broken.iter().all(|broken| broken.value.is_finite());
        if !is_finite && self.relaxations.is_empty() {
            sentences.push("No change is sufficient: the motion is not finite.".to_owned());
        }
        sentences
    }
}

/// A factor above 1 with four decimals, not rounded to 1.
fn formatted_factor(factor: f64) -> String {
    format!("{:.4}", factor.max(1.0001))
}

/// Describes the change of one limit, with its factor if the limit is a magnitude.
fn described_change(kind: LimitKind, change: &LimitChange) -> String {
    let (subject, now, needed, unit) = change;
    let what = match kind {
        LimitKind::Position | LimitKind::Box => "half range",
        LimitKind::Floor => return format!("`{subject}` height {needed:.4} {unit} instead of {now:.4}"),
        LimitKind::SelfCollision if *needed <= 0.0 => {
            return format!("`{subject}` must be allowed to touch (clearance now {now:.4} {unit})");
        }
        LimitKind::SelfCollision => return format!("`{subject}` clearance {needed:.4} {unit} instead of {now:.4}"),
        LimitKind::Column => "distance",
        _ => "limit",
    };
    format!("`{subject}` {what} {needed:.4} {unit} instead of {now:.4} (factor {:.3})", needed / now)
}
