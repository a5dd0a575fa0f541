//! The limits that a motion breaks, and changes that would make it feasible.

use super::kind::{Constraint, LimitKind};
use super::set::{LimitSet, LimitWorkspace};
use crate::motion::Motion;

/// A limit is broken above this value, as in the final check.
pub(super) const TOLERANCE: f64 = 1e-6;

/// The slowest run that is considered, as a multiple of the duration.
pub(super) const LARGEST_STRETCH: f64 = 1000.0;

/// A limit that the best motion found still breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct BrokenLimit {
    /// The limit.
    pub constraint: Constraint,
    /// Its largest value, above 0.
    pub value: f64,
    /// When, s.
    pub at_s: f64,
}

/// What to change in one limit: `(subject, limit now, limit needed, unit)`. Ranges count from their middle.
pub type LimitChange = (String, f64, f64, &'static str);

/// One change that would make the motion feasible as it is.
#[derive(Clone, Debug, PartialEq)]
pub enum Relaxation {
    /// The same path run slower: `q(t / factor)`.
    Stretch {
        /// Factor on the duration, above 1.
        factor: f64,
        /// The longer duration, s.
        duration_s: f64,
    },
    /// Other values of the limits of one kind.
    Limits {
        /// The kind.
        kind: LimitKind,
        /// What to change.
        changes: Vec<LimitChange>,
    },
    /// Other values of the limits of one kind, with which another motion is possible.
    OtherMotion {
        /// The kind.
        kind: LimitKind,
        /// What to change.
        changes: Vec<LimitChange>,
    },
    /// Several changes at once, where no single one would do: those with the smallest sum of relative changes.
    Combined {
        /// Factor on the duration; 1 if a slower run is no part of it.
        factor: f64,
        /// The duration with it, s.
        duration_s: f64,
        /// Limits that must give as well.
        changes: Vec<(LimitKind, LimitChange)>,
    },
}

/// The limits that a motion breaks, worst first.
pub(super) fn broken_limits(
    set: &LimitSet,
    workspace: &mut LimitWorkspace,
    times_s: &[f64],
    motion: &Motion,
) -> Vec<BrokenLimit> {
    let mut values = Vec::new();
    set.values(workspace, motion, &mut values);
    let mut broken = Vec::new();
    for (constraint, values) in set.constraints().iter().zip(values.chunks_exact(motion.samples.max(1))) {
        let worst = values.iter().map(|c| if c.is_nan() { f64::INFINITY } else { *c }).zip(times_s);
        if let Some((value, at_s)) = worst.max_by(|a, b| a.0.total_cmp(&b.0))
            && value > TOLERANCE
        {
            broken.push(BrokenLimit { constraint: constraint.clone(), value, at_s: *at_s });
        }
    }
    broken.sort_by(|a, b| b.value.total_cmp(&a.value));
    broken
}

/// The change of one limit that makes room for the motion.
pub(super) fn change(broken: &BrokenLimit) -> LimitChange {
    let Constraint { kind, subject, middle, size, unit } = &broken.constraint;
    let needed = broken.constraint.quantity(broken.value);
    let now = if matches!(kind, LimitKind::Floor | LimitKind::SelfCollision) { *middle } else { *size };
    (subject.clone(), now, needed, unit)
}

/// The motion of `q(t / factor)` at the stretched times.
pub(super) fn stretched(motion: &Motion, factor: f64) -> Motion {
    let scaled = |values: &[f64], by: f64| values.iter().map(|x| x * by).collect();
    let inverse = 1.0 / factor;
    Motion {
        dq: scaled(&motion.dq, inverse),
        ddq: scaled(&motion.ddq, inverse * inverse),
        dddq: scaled(&motion.dddq, inverse * inverse * inverse),
        ..motion.clone()
    }
}
