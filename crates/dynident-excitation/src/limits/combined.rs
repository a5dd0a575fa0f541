//! Where no single change would do: the smallest changes that do together.

use super::relaxation::{BrokenLimit, LARGEST_STRETCH, Relaxation, broken_limits, change, stretched};
use super::set::LimitSet;
use crate::motion::Motion;

/// Places of the first look, and golden-section steps after it (each 0.618 of the last: 1e-5 of a first step).
const PLACES: usize = 24;
const STEPS: usize = 24;

/// A slower run is part of a change from this share on.
const LEAST_SLOWING: f64 = 1e-3;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A run slower by a factor s with every limit that is then still broken made just wide enough, the factor chosen for
/// the smallest sum of relative changes, `s - 1 + Σ c_i(s)`.
///
/// `c` is the constraint's value: the share of the limit that is missing, for the floor metres. A slower run fixes
/// velocity, acceleration, jerk and the part of torque that gravity does not ask for, so the sum falls before it rises;
/// it is looked at on a grid up to where s - 1 alone costs more than limits alone, then by golden section. `None` if a
/// motion is not finite, or `stop` says so.
pub(super) fn smallest_combination(
    set: &LimitSet,
    times_s: &[f64],
    motion: &Motion,
    stop: &dyn Fn() -> bool,
) -> Option<Relaxation> {
    let mut workspace = set.workspace();
    let mut at = |factor: f64| {
        let broken = broken_limits(set, &mut workspace, times_s, &stretched(motion, factor));
        (factor - 1.0 + broken.iter().map(|broken| broken.value).sum::<f64>(), factor, broken)
    };
    if stop() {
        return None;
    }
    let mut best: (f64, f64, Vec<BrokenLimit>) = at(1.0);
    if !best.0.is_finite() {
        return None;
    }
    if best.2.iter().any(|broken| broken.constraint.kind.depends_on_time()) {
        let most = (1.0 + best.0).min(LARGEST_STRETCH);
        // Squares: small factors are the common case.
        let place = |k: usize| 1.0 + (most - 1.0) * (k as f64 / PLACES as f64).powi(2);
        let mut lowest = 0;
        for k in 1..=PLACES {
            if stop() {
                return None;
            }
            let found = at(place(k));
            if found.0 < best.0 {
                (best, lowest) = (found, k);
            }
        }
        let (mut from, mut to) = (place(lowest.saturating_sub(1)), place((lowest + 1).min(PLACES)));
        for _ in 0..STEPS {
            if stop() {
                return None;
            }
            let (left, right) = (to - GOLDEN * (to - from), from + GOLDEN * (to - from));
            let (left, right) = (at(left), at(right));
            if left.0 <= right.0 {
                to = right.1;
            } else {
                from = left.1;
            }
            for found in [left, right] {
                if found.0 < best.0 {
                    best = found;
                }
            }
        }
    }
    // A run that is hardly slower is no change worth making: its share goes to the limits.
    if best.1 - 1.0 < LEAST_SLOWING {
        best = at(1.0);
    }
    let (_, factor, broken) = best;
    let duration_s = times_s.last().zip(times_s.first()).map_or(0.0, |(last, first)| last - first);
    let changes = broken.iter().map(|broken| (broken.constraint.kind, change(broken))).collect();
    Some(Relaxation::Combined { factor, duration_s: duration_s * factor, changes })
}
