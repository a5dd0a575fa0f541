//! Violated limits of a motion, and changes that make it feasible.

use super::kind::{Constraint, LimitKind};
use super::set::{LimitSet, LimitWorkspace};
use crate::motion::Motion;

/// Value above which a limit is violated, as in the final check.
pub(super) const TOLERANCE: f64 = 1e-6;

pub(super) const MAX_STRETCH: f64 = 1000.0;

/// A limit that the best motion found violates.
#[derive(Clone, Debug, PartialEq)]
pub struct BrokenLimit {
    /// The limit.
    pub constraint: Constraint,
    /// Largest constraint value, above 0.
    pub value: f64,
    /// Time of the largest value, s.
    pub at_s: f64,
}

/// Change of one limit: `(subject, current limit, required limit, unit)`. Ranges are given as half widths.
pub type LimitChange = (String, f64, f64, &'static str);

/// A change that makes the motion feasible.
#[derive(Clone, Debug, PartialEq)]
pub enum Relaxation {
    /// The same path, run more slowly: `q(t / factor)`.
    Stretch {
        /// Factor on the duration, above 1.
        factor: f64,
        /// The longer duration, s.
        duration_s: f64,
    },
    /// Wider limits of one kind.
    Limits {
        /// Kind of the limits.
        kind: LimitKind,
        /// Changes of single limits.
        changes: Vec<LimitChange>,
    },
    /// Wider limits of one kind that make another motion possible.
    OtherMotion {
        /// Kind of the limits.
        kind: LimitKind,
        /// Changes of single limits.
        changes: Vec<LimitChange>,
    },
    /// Several changes with the smallest sum of relative changes, if no single change is sufficient.
    Combined {
        /// Factor on the duration; 1 without slower motion.
        factor: f64,
        /// Resulting duration, s.
        duration_s: f64,
        /// Additional wider limits.
        changes: Vec<(LimitKind, LimitChange)>,
    },
}

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

pub(super) fn change(broken: &BrokenLimit) -> LimitChange {
    let Constraint { kind, subject, middle, size, unit } = &broken.constraint;
    let needed = broken.constraint.quantity(broken.value);
    let now = if matches!(kind, LimitKind::Floor | LimitKind::SelfCollision) { *middle } else { *size };
    (subject.clone(), now, needed, unit)
}

/// Motion `q(t / factor)` at the stretched times.
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
