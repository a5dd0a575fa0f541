//! Shrinks a motion outside the limits until it keeps them.
//!
//! A search always ends with a motion that is slightly outside the limits: by 10⁻⁴ after an interrupted polish, by
//! some hundredths without polish. If the motion is shrunk by that share around a posture inside the limits, it keeps
//! them, and the criterion changes by about that share.

use super::assess::{Assessment, assess, extremes};
use super::{DesignTask, ranges};
use crate::criteria::Criterion;
use crate::motion::Motion;
use dynident_model::sample::Random;

const MAX_SHRINK: f64 = 0.9;

/// Added to each share, because rounding can cause violations of 10⁻¹⁶.
const ROUNDING_MARGIN: f64 = 1e-9;

const MAX_DOUBLINGS: usize = 8;

/// First share if all joints keep their own limits, but torque or place limits are violated.
const FIRST_SHARE: f64 = 1.0 / 512.0;

/// Speed and range of a motion near standstill, as shares of the limits. Not zero, because some families divide by
/// the size of the motion.
const STANDSTILL_SHARE: f64 = 1e-6;

/// Interpolates `outside` towards standstill in the middle of each joint's path, with the smallest of the tested
/// shares that keeps all limits between samples. `None` if `outside` already keeps the limits, if a motion of a tenth
/// of the size still violates them, or after `stop` returns true.
///
/// For a linear family the share of each joint that violates its own limits is known. Limits on a joint's motion are
/// convex. On the way to a motion inside the limits, a violation `v > 0` that ends at `-d` is therefore zero at the
/// share `v / (v + d)` at the latest. The other joints need not change. If torque or place limits are still violated,
/// or the family is nonlinear, larger shares of all joints are tested.
pub(super) fn shrunk(
    task: &DesignTask<'_>,
    criterion: &dyn Criterion,
    outside: &Assessment,
    grids: [&[f64]; 2],
    stop: &dyn Fn() -> bool,
) -> Option<Assessment> {
    let [fine, logged] = grids;
    if outside.violation <= 0.0 || !outside.violation.is_finite() {
        return None;
    }
    let still = standing_still(task, &outside.parameters, fine);
    let at_rest = extremes(task, &still, fine);
    let joints = task.family.joints().max(1);
    let mut shares = vec![0.0; joints];
    for band in task.limits.bands() {
        let (value, end) = (outside.extremes[band.row], at_rest[band.row]);
        if value > 0.0 {
            let share = if end < 0.0 { value / (value - end) + ROUNDING_MARGIN } else { MAX_SHRINK };
            shares[band.joint] = share.max(shares[band.joint]);
        }
    }
    let each = (outside.parameters.len() / joints).max(1);
    if shares.iter().all(|share| *share == 0.0) {
        shares.fill(FIRST_SHARE.max(outside.violation).min(MAX_SHRINK));
    }
    let of_all = shares.iter().copied().fold(FIRST_SHARE, f64::max);
    for doubling in 0..=MAX_DOUBLINGS {
        if shares.iter().any(|share| *share > MAX_SHRINK) || stop() {
            return None;
        }
        let ways = outside.parameters.iter().zip(&still).enumerate();
        let between = ways.map(|(k, (from, to))| from + shares[(k / each).min(joints - 1)] * (to - from)).collect();
        let assessed = assess(task, criterion, between, fine, logged);
        if assessed.violation <= 0.0 {
            return Some(assessed);
        }
        let more = of_all * f64::from(1 << doubling);
        for share in &mut shares {
            *share = share.max(more);
        }
    }
    None
}

/// Parameters of a motion at near standstill in the middle of each joint's range of motion.
fn standing_still(task: &DesignTask<'_>, parameters: &[f64], times: &[f64]) -> Vec<f64> {
    let mut motion = Motion::default();
    task.family.motion(parameters, times, &mut motion);
    let (mut positions, mut speeds) = ranges(task.limits);
    for (joint, range) in positions.iter_mut().enumerate() {
        let own = &motion.q[motion.of(joint)];
        let low = own.iter().copied().fold(f64::INFINITY, f64::min);
        let high = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let half = STANDSTILL_SHARE * (range[1] - range[0]);
        let middle = (0.5 * (low + high)).max(range[0] + half).min(range[1] - half);
        *range = [middle - half, middle + half];
        speeds[joint] *= STANDSTILL_SHARE;
    }
    task.family.random(&positions, &speeds, &mut Random::new(1))
}

#[cfg(test)]
mod tests {
    use super::super::{DesignSettings, grid, timed};
    use super::*;
    use crate::check::check_limits;
    use crate::criteria::ConditionNumber;
    use crate::families::{Fourier, FourierSettings};
    use crate::family::Family;
    use crate::limits::{LimitSet, Limits};
    use core::ops::ControlFlow;
    use core::sync::atomic::{AtomicU64, Ordering};
    use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
    use dynident_model::{Model, load_robot};

    fn robot(name: &str) -> (Model, Limits) {
        let path = format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"));
        let model = load_robot(path).unwrap().model;
        let mut limits = Limits::from_model(&model);
        for joint in &mut limits.joints {
            joint.acceleration = Some(10.0);
        }
        (model, limits)
    }

    fn with_task<T>(
        (model, limits): &(Model, Limits),
        family: &dyn Family,
        of: impl FnOnce(&DesignTask<'_>) -> T,
    ) -> T {
        let set = LimitSet::new(limits, model).unwrap();
        let base = BaseParameters::new(model, &[], &BaseParameterSettings::default());
        let layout = PanelLayout::new(model, base.base_columns());
        let condition = ConditionNumber::default();
        of(&DesignTask {
            family,
            criteria: &[&condition],
            limits: &set,
            layout: &layout,
            torque_std_nm: &vec![1.0; model.dof()],
            prior: None,
        })
    }

    fn fourier(model: &Model) -> Fourier {
        Fourier::new(model.dof(), 10.0, &FourierSettings::default()).unwrap()
    }

    #[test]
    fn interrupted_searches_keep_the_limits() {
        let mut failures = Vec::new();
        for (name, seed) in [("ur10", 1), ("panda_arm7", 2), ("iiwa14", 3)] {
            let robot = robot(name);
            let family = fourier(&robot.0);
            for asked in [60, 120, 250, 500, 700, 900] {
                let design = with_task(&robot, &family, |task| {
                    // The fake clock jumps past the time limit after a number of calls, at least one per evaluation, so
                    // that the test does not depend on the computer.
                    let clock = AtomicU64::new(0);
                    let elapsed = || if clock.fetch_add(1, Ordering::Relaxed) < asked { 0.0 } else { 1.0 };
                    let settings = DesignSettings { time_limit_s: Some(1.0), seed, ..DesignSettings::default() };
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                    pool.install(|| timed(task, &settings, &|_| ControlFlow::Continue(()), &elapsed)).unwrap()
                });
                // Dense enough that a peak of five harmonics between samples is below the tolerance of the check.
                let reports = check_limits(&robot.1, &robot.0, 10.0, 5_000.0, |times, out: &mut Motion| {
                    family.motion(&design.parameters, times, out);
                });
                let broken: Vec<_> = reports.unwrap().into_iter().filter(|report| report.violated).collect();
                if !broken.is_empty() || design.violation > 0.0 {
                    failures.push(format!("{name}, {asked}, {:.1e}: {broken:?}", design.violation));
                }
            }
        }
        assert!(failures.is_empty(), "{failures:#?}");
    }

    #[test]
    fn shrinking_costs_about_the_violation() {
        // The range of joint 4 does not contain zero: a motion must shrink around a posture, not its parameters to
        // zero.
        let robot = robot("panda_arm7");
        let family = fourier(&robot.0);
        with_task(&robot, &family, |task| {
            let (fine, logged) = (grid(10.0, 127), grid(10.0, 1001));
            let condition = ConditionNumber::default();
            let judged = |parameters: Vec<f64>| assess(task, &condition, parameters, &fine, &logged);
            let (positions, speeds) = ranges(task.limits);
            let start = family.random(&positions, &speeds, &mut Random::new(3));
            let first = judged(start.clone());
            let inside = shrunk(task, &condition, &first, [&fine, &logged], &|| false).unwrap_or(first);
            assert!(inside.violation <= 0.0);
            // Enlarged around its posture such that it violates a limit by some hundredths.
            let still = standing_still(task, &inside.parameters, &fine);
            let larger = |by: f64| {
                judged(inside.parameters.iter().zip(&still).map(|(p, still)| still + by * (p - still)).collect())
            };
            let (mut below, mut above) = (1.0, 8.0);
            for _ in 0..30 {
                let middle = 0.5 * (below + above);
                *(if larger(middle).violation <= 0.01 { &mut below } else { &mut above }) = middle;
            }
            let outside = larger(below);
            assert!(outside.violation > 0.009, "{}", outside.violation);
            let smaller = shrunk(task, &condition, &outside, [&fine, &logged], &|| false).expect("a hundredth does");
            assert!(smaller.violation <= 0.0);
            // The regressor scales with the motion, and its smallest singular value at most with the square of the
            // acceleration: two hundredths of the figure, and as much for the position part of a range that is not
            // centred.
            let lost = smaller.figure.unwrap() / outside.figure.unwrap() - 1.0;
            assert!(lost < 0.04, "{lost}");
            assert!(shrunk(task, &condition, &smaller, [&fine, &logged], &|| false).is_none());
        });
    }
}
