//! Search for feasibility alone, if a search ends outside the limits.

use super::assess::{Assessment, assess};
use super::effort::restoration_budget;
use super::rounds::{Rounds, Stop};
use super::shrunk::shrunk;
use super::way_inside::way_inside;
use super::{DesignSettings, DesignTask, ranges};
use crate::criteria::{Criterion, ValueAndGradient};
use crate::optimisers::OptimiserError;
use core::sync::atomic::{AtomicBool, Ordering};
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// Number of random starts in addition to the best motion so far, and minimum number of evaluations of each descent,
/// so that a small search can still find a feasible motion.
const RANDOM_STARTS: usize = 4;
const MIN_EVALUATIONS: usize = 400;

/// Maximum number of descents from one start, with wider margins while a limit is violated between samples; and the
/// largest increase of a margin.
const MAX_DESCENTS: usize = 4;
const MAX_MARGIN_STEP: f64 = 0.02;

const INITIAL_MARGIN: f64 = 0.003;

/// Zero objective: only feasibility is optimised.
#[derive(Debug)]
pub(super) struct FeasibilityOnly;

impl Criterion for FeasibilityOnly {
    fn name(&self) -> &'static str {
        "feasibility"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        Some((0.0, DMatrix::zeros(information.nrows(), information.ncols())))
    }

    fn figure(&self, _: &DMatrix<f64>) -> Option<f64> {
        Some(0.0)
    }

    /// Scale that makes the first penalty about ten with the evaluations of this search. The penalty can be high,
    /// because with a zero objective a motion outside the limits gains nothing.
    fn scale(&self, _: usize) -> f64 {
        50.0
    }

    /// The gradients are those of violations, which are shares of limits, so their scale is one.
    fn gradient_scale(&self, _: usize) -> f64 {
        1.0
    }
}

/// Returns the best motion, if necessary after a search for feasibility alone, and the number of evaluations. The
/// search starts at the best motion so far and at random motions, until one motion keeps every limit between samples.
/// One more descent by the criterion follows. Starts run one after another, so that the first success is the same for
/// any number of threads.
///
/// A criterion can prevent a search from returning inside the limits. Its slope grows without bound when an
/// ill-conditioned motion is forced into narrow limits, while the penalty grows only in steps.
pub(crate) fn restored(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    kept: Assessment,
    grids: [&[f64]; 2],
    stop: &Stop<'_>,
) -> Result<(Assessment, usize), OptimiserError> {
    let [fine, logged] = grids;
    let criterion = task.criteria[task.criteria.len() - 1];
    let mut random = Random::new(settings.seed ^ 0x5e57);
    let (positions, speeds) = ranges(task.limits);
    let (mut best, mut evaluations) = (kept, 0);
    let (least, ended) = (best.violation, AtomicBool::new(false));
    let report = |value: f64, violation: f64| {
        ended.fetch_or(stop(value, violation), Ordering::Relaxed);
        ended.load(Ordering::Relaxed)
    };
    let over = || report(0.0, least);
    // Without a criterion, the metric does not bound the steps in directions without an active limit.
    let [plain, rounds] = [false, true].map(|shaped| Rounds::new(task, fine, logged.len(), shaped));
    let most = restoration_budget(task, settings, fine.len());
    for start in 0..=RANDOM_STARTS {
        let mut parameters =
            if start == 0 { best.parameters.clone() } else { task.family.random(&positions, &speeds, &mut random) };
        let mut margins = vec![INITIAL_MARGIN; task.limits.constraints().len()];
        for _ in 0..MAX_DESCENTS {
            // A third of the remaining evaluations, so that some are left for other starts.
            let left = most.saturating_sub(evaluations);
            let budget = settings.polish_evaluations.max(MIN_EVALUATIONS).min(left.div_ceil(3).max(1));
            let found = plain.polish(&FeasibilityOnly, &margins, parameters.into(), budget, &|value, violation| {
                violation <= 0.0 || report(value, violation)
            })?;
            evaluations += found.evaluations;
            let assessed = assess(task, criterion, found.best.feasible, fine, logged);
            let on_samples = found.best.violation <= INITIAL_MARGIN;
            let from = improve(&mut best, &assessed, task, [fine, logged], &over);
            parameters = from.parameters;
            if from.whole && !over() {
                let budget = settings.polish_evaluations.min(most.saturating_sub(evaluations).max(1));
                let found = rounds.polish(criterion, &margins, parameters.into(), budget, &report)?;
                evaluations += found.evaluations;
                let assessed = assess(task, criterion, found.best.feasible, fine, logged);
                if assessed.better_than(&best) {
                    best = assessed;
                }
                return Ok((best, evaluations));
            }
            if from.whole || !on_samples || evaluations >= most || over() {
                break;
            }
            for (margin, c) in margins.iter_mut().zip(&assessed.extremes) {
                *margin += if *c > 0.0 { c.min(MAX_MARGIN_STEP) + 1e-6 } else { 0.0 };
            }
        }
        if evaluations >= most || over() {
            break;
        }
    }
    Ok((best, evaluations))
}

struct NextStart {
    parameters: Vec<f64>,
    whole: bool,
}

/// Improves `best` by a motion of a descent for feasibility alone, by an interpolation of both, or by a shrunk motion.
fn improve(
    best: &mut Assessment,
    found: &Assessment,
    task: &DesignTask<'_>,
    grids: [&[f64]; 2],
    stop: &dyn Fn() -> bool,
) -> NextStart {
    let criterion = task.criteria[task.criteria.len() - 1];
    let whole = found.violation <= 0.0;
    // A motion close to the best one preserves most of the criterion's value.
    if let Some(between) = way_inside(task, criterion, best, found, grids, stop) {
        *best = between;
        NextStart { parameters: best.parameters.clone(), whole }
    } else if let Some(smaller) = shrunk(task, criterion, found, grids, stop)
        && smaller.better_than(best)
    {
        *best = smaller;
        NextStart { parameters: best.parameters.clone(), whole: true }
    } else {
        if found.better_than(best) {
            *best = found.clone();
        }
        NextStart { parameters: found.parameters.clone(), whole }
    }
}
