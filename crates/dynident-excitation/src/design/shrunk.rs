//! A motion outside the limits made smaller until it keeps them.
//!
//! Whatever a search was given to do, the last thing it has is a motion a little outside: by 10⁻⁴ after a polish that
//! was cut short, by some hundredths after none. About a posture inside the limits the same motion, smaller by as much,
//! keeps them, and a criterion loses about as much as the motion does.

use super::assess::{Assessment, assess, extremes};
use super::{DesignTask, ranges};
use crate::criteria::Criterion;
use crate::motion::Motion;
use dynident_model::sample::Random;

/// Most that a motion is shrunk by: a search that ends among its first steps is far outside.
const MOST: f64 = 0.9;

/// Added to each share, so that rounding does not leave a limit broken by 10⁻¹⁶.
const HAIR: f64 = 1e-9;

/// How often a share that was not enough is doubled.
const DOUBLINGS: usize = 8;

/// The first share of a joint whose own limits are kept, where something else is broken: torques, places.
const FIRST_SHARE: f64 = 1.0 / 512.0;

/// Speed and width of the range of a motion that stands nearly still, as shares of the limits. Not zero, so that it
/// stays a motion of families that divide by their size.
const STILL: f64 = 1e-6;

/// `outside`, between it and standing still in the middle of each joint's own way,
/// with the smallest of the shares tried that keeps all limits between samples. None if it keeps them already, or if
/// a tenth of the motion is not small enough, or once `stop` says so.
///
/// A family whose motions are linear in its parameters needs no trial where single joints break their own limits: on
/// the way to a motion inside a value `v > 0` that ends at `-d` is zero at the share `v / (v + d)` at the latest,
/// because limits on a joint's motion are convex; and the other joints need not change. Whatever is still broken then,
/// by torques, places or a family that is not linear, is tried with more, of all joints.
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
            let share = if end < 0.0 { value / (value - end) + HAIR } else { MOST };
            shares[band.joint] = share.max(shares[band.joint]);
        }
    }
    let each = (outside.parameters.len() / joints).max(1);
    if shares.iter().all(|share| *share == 0.0) {
        shares.fill(FIRST_SHARE.max(outside.violation).min(MOST));
    }
    let of_all = shares.iter().copied().fold(FIRST_SHARE, f64::max);
    for doubling in 0..=DOUBLINGS {
        if shares.iter().any(|share| *share > MOST) || stop() {
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

/// Parameters of a motion that stands nearly still in the middle of what each joint does.
fn standing_still(task: &DesignTask<'_>, parameters: &[f64], times: &[f64]) -> Vec<f64> {
    let mut motion = Motion::default();
    task.family.motion(parameters, times, &mut motion);
    let (mut positions, mut speeds) = ranges(task.limits);
    for (joint, range) in positions.iter_mut().enumerate() {
        let own = &motion.q[motion.of(joint)];
        let low = own.iter().copied().fold(f64::INFINITY, f64::min);
        let high = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let half = STILL * (range[1] - range[0]);
        let middle = (0.5 * (low + high)).max(range[0] + half).min(range[1] - half);
        *range = [middle - half, middle + half];
        speeds[joint] *= STILL;
    }
    // Which of these motions it is makes no difference to be seen.
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

    /// Runs `of` with the condition number of motions of `family` as the task.
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
    fn a_search_that_ends_anywhere_keeps_the_limits() {
        let mut failures = Vec::new();
        for (name, seed) in [("ur10", 1), ("panda_arm7", 2), ("iiwa14", 3)] {
            let robot = robot(name);
            let family = fourier(&robot.0);
            for asked in [60, 120, 250, 500, 700, 900] {
                let design = with_task(&robot, &family, |task| {
                    // The time is up when the clock has been asked so often, at least once an evaluation: how long the
                    // computer takes makes no difference.
                    let clock = AtomicU64::new(0);
                    let elapsed = || if clock.fetch_add(1, Ordering::Relaxed) < asked { 0.0 } else { 1.0 };
                    let settings = DesignSettings { time_limit_s: Some(1.0), seed, ..DesignSettings::default() };
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                    pool.install(|| timed(task, &settings, &|_| ControlFlow::Continue(()), &elapsed)).unwrap()
                });
                // Often enough that a peak of five harmonics between samples is below the check's tolerance.
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
    fn what_is_broken_by_a_share_costs_about_that_share() {
        // Joint 4's range does not hold zero: a motion is shrunk about a posture, not its numbers to zero.
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
            // As much larger about its posture as breaks a limit by some hundredths.
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
            // The regressor goes with the motion, and its smallest singular value with the acceleration's square at
            // most: two hundredths of the figure, and as much for what position takes of a range that is not centred.
            let lost = smaller.figure.unwrap() / outside.figure.unwrap() - 1.0;
            assert!(lost < 0.04, "{lost}");
            assert!(shrunk(task, &condition, &smaller, [&fine, &logged], &|| false).is_none());
        });
    }
}
