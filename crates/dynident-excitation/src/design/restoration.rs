//! When a search ends outside the limits: a search for the limits alone.

use super::assess::{Assessment, assess};
use super::effort::most_of_restoration;
use super::rounds::{Rounds, Stop};
use super::shrunk::shrunk;
use super::way_inside::way_inside;
use super::{DesignSettings, DesignTask, ranges};
use crate::criteria::{Criterion, ValueAndGradient};
use crate::optimisers::OptimiserError;
use core::sync::atomic::{AtomicBool, Ordering};
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// Random starts beside the best so far, and evaluations of each descent at least: a small search must still find its
/// way inside.
const STARTS: usize = 4;
const EVALUATIONS: usize = 400;

/// Descents from one start, with wider margins while something is broken between samples, and the most that one of them
/// widens.
const ROUNDS: usize = 4;
const WIDEST: f64 = 0.02;

/// First margin on samples, as a share of each limit.
const MARGIN: f64 = 0.003;

/// Nothing to be gained but the limits.
#[derive(Debug)]
pub(super) struct Anything;

impl Criterion for Anything {
    fn name(&self) -> &'static str {
        "anything"
    }

    fn value_and_derivative(&self, information: &DMatrix<f64>) -> ValueAndGradient {
        Some((0.0, DMatrix::zeros(information.nrows(), information.ncols())))
    }

    fn figure(&self, _: &DMatrix<f64>) -> Option<f64> {
        Some(0.0)
    }

    /// Nothing is to be found outside the limits here: with the evaluations of a restoration the first penalty is about
    /// ten.
    fn scale(&self, _: usize) -> f64 {
        50.0
    }

    /// There is no value: gradients are those of violations, which are shares of limits.
    fn gradient_scale(&self, _: usize) -> f64 {
        1.0
    }
}

/// The best motion, if need be after a search for the limits alone: from the best so far and from random starts, until
/// one keeps every limit between samples; from there one more descent by the criterion. Starts follow one another, so
/// that the first that succeeds is the same on any number of threads. Also the number of evaluations.
///
/// A criterion can hold a search outside: its slope grows without end as an ill-conditioned motion is pressed into
/// narrow limits, while the penalty only grows in steps.
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
    // Asked where nothing else is to be reported.
    let (least, ended) = (best.violation, AtomicBool::new(false));
    let report = |value: f64, violation: f64| {
        ended.fetch_or(stop(value, violation), Ordering::Relaxed);
        ended.load(Ordering::Relaxed)
    };
    let over = || report(0.0, least);
    // Without a criterion nothing says how long a step may be where no limit pushes.
    let [plain, rounds] = [false, true].map(|shaped| Rounds::new(task, fine, logged.len(), shaped));
    let most = most_of_restoration(task, settings, fine.len());
    for start in 0..=STARTS {
        let mut parameters =
            if start == 0 { best.parameters.clone() } else { task.family.random(&positions, &speeds, &mut random) };
        let mut margins = vec![MARGIN; task.limits.constraints().len()];
        for _ in 0..ROUNDS {
            // A part of what is left, so that other starts have their turn.
            let left = most.saturating_sub(evaluations);
            let budget = settings.polish_evaluations.max(EVALUATIONS).min(left.div_ceil(3).max(1));
            let found = plain.polish(&Anything, &margins, parameters.into(), budget, &|value, violation| {
                violation <= 0.0 || report(value, violation)
            })?;
            evaluations += found.evaluations;
            let assessed = assess(task, criterion, found.best.feasible, fine, logged);
            let on_samples = found.best.violation <= MARGIN;
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
                *margin += if *c > 0.0 { c.min(WIDEST) + 1e-6 } else { 0.0 };
            }
        }
        if evaluations >= most || over() {
            break;
        }
    }
    Ok((best, evaluations))
}

/// Where the next descent begins.
struct NextStart {
    parameters: Vec<f64>,
    /// Whether this motion keeps all limits between samples.
    whole: bool,
}

/// Improves `best` by a motion of a descent for the limits alone, or by one between both, or by a smaller one.
fn improve(
    best: &mut Assessment,
    found: &Assessment,
    task: &DesignTask<'_>,
    grids: [&[f64]; 2],
    stop: &dyn Fn() -> bool,
) -> NextStart {
    let criterion = task.criteria[task.criteria.len() - 1];
    let whole = found.violation <= 0.0;
    // Slightly away from the best motion most of what the criterion had found is still there.
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
