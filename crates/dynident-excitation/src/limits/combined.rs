//! Smallest combination of changes of limits and speed, for motions that no single change makes feasible.

use super::relaxation::{BrokenLimit, MAX_STRETCH, Relaxation, broken_limits, change, stretched};
use super::set::LimitSet;
use crate::motion::Motion;

/// Number of points of the initial grid, and of golden-section steps after it, which reduce the interval by 1e-5.
const GRID_POINTS: usize = 24;
const GOLDEN_STEPS: usize = 24;

const MIN_SLOWDOWN: f64 = 1e-3;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Slows the motion down by a factor s and widens each limit that is still violated by the necessary amount. The
/// factor minimises the sum of relative changes, `s - 1 + Σ c_i(s)`.
///
/// `c_i` is the violation as a share of the limit (for the floor as a share of the arm's length). Slower motion
/// reduces velocity, acceleration, jerk and the part of the torque that is not gravity, so the sum first falls and
/// then rises. It is evaluated on a grid up to the s whose `s - 1` alone exceeds the sum at s = 1, then refined by
/// golden section. `None` if a motion is not finite or `stop` returns true.
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
        let most = (1.0 + best.0).min(MAX_STRETCH);
        // A quadratic grid, because small factors are the common case.
        let place = |k: usize| 1.0 + (most - 1.0) * (k as f64 / GRID_POINTS as f64).powi(2);
        let mut lowest = 0;
        for k in 1..=GRID_POINTS {
            if stop() {
                return None;
            }
            let found = at(place(k));
            if found.0 < best.0 {
                (best, lowest) = (found, k);
            }
        }
        let (mut from, mut to) = (place(lowest.saturating_sub(1)), place((lowest + 1).min(GRID_POINTS)));
        for _ in 0..GOLDEN_STEPS {
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
    if best.1 - 1.0 < MIN_SLOWDOWN {
        best = at(1.0);
    }
    let (_, factor, broken) = best;
    let duration_s = times_s.last().zip(times_s.first()).map_or(0.0, |(last, first)| last - first);
    let changes = broken.iter().map(|broken| (broken.constraint.kind, change(broken))).collect();
    Some(Relaxation::Combined { factor, duration_s: duration_s * factor, changes })
}
