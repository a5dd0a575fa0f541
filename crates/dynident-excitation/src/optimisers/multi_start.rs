//! Runs the augmented Lagrangian method from several starts in parallel, and selects the best result.

use super::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, ConstrainedProblem,
    OptimiserError, Progress, augmented_lagrangian,
};
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MultiStartResult {
    /// Index of the best start: lowest objective among the feasible ones, otherwise smallest violation.
    pub best_start: usize,
    /// Results of all starts, in order; an error if the problem is undefined at the start.
    pub runs: Vec<Result<AugmentedLagrangianResult, OptimiserError>>,
}

impl MultiStartResult {
    pub(crate) fn best(&self) -> Option<&AugmentedLagrangianResult> {
        self.runs.get(self.best_start)?.as_ref().ok()
    }

    pub(crate) fn evaluations(&self) -> usize {
        self.runs.iter().flatten().map(|run| run.evaluations).sum()
    }
}

/// Runs [`augmented_lagrangian()`] from every start, in parallel, each on its own problem from `problem`.
///
/// `watch` is called after every evaluation with the best point of all starts, and can stop the search. `iteration`
/// and `evaluations` are those of the start that calls it. Unless the search is stopped, the result does not depend
/// on the number of threads; among equal results the first start is best. Starts that have not begun when the search
/// is stopped are treated as undefined.
///
/// # Errors
/// No start; settings or bounds out of range.
pub(crate) fn multi_start<P: ConstrainedProblem>(
    problem: impl Fn() -> P + Sync,
    starts: &[AugmentedLagrangianState],
    settings: &AugmentedLagrangianSettings,
    watch: impl Fn(&Progress<'_>) -> ControlFlow<()> + Sync,
) -> Result<MultiStartResult, OptimiserError> {
    if starts.is_empty() {
        return Err(OptimiserError::Length { what: "starts", expected: 1, found: 0 });
    }
    settings.validate()?;
    super::check_bounds(&problem().bounds(), false)?;
    let best: Mutex<(Vec<f64>, f64, f64)> = Mutex::new((Vec::new(), f64::INFINITY, f64::INFINITY));
    let tolerance = settings.feasibility_tolerance;
    let stopped = AtomicBool::new(false);
    let runs: Vec<_> = starts
        .par_iter()
        .map(|start| {
            // The search can only be stopped after an evaluation, so a best point exists.
            if stopped.load(Ordering::Relaxed) {
                return Err(OptimiserError::Start);
            }
            let mut hear = |progress: &Progress<'_>| {
                let mut best = best.lock().unwrap_or_else(PoisonError::into_inner);
                if before((progress.value, progress.violation), (best.1, best.2), tolerance) {
                    *best = (progress.best.to_vec(), progress.value, progress.violation);
                }
                let flow = watch(&Progress { best: &best.0, value: best.1, violation: best.2, ..*progress });
                stopped.fetch_or(flow.is_break(), Ordering::Relaxed);
                flow
            };
            augmented_lagrangian(&mut problem(), start, settings, &mut hear)
        })
        .collect();
    let rank = |run: &Result<AugmentedLagrangianResult, OptimiserError>| {
        run.as_ref().map_or((f64::INFINITY, f64::INFINITY), |run| (run.value, run.violation))
    };
    let mut best_start = 0;
    for index in 1..runs.len() {
        if before(rank(&runs[index]), rank(&runs[best_start]), tolerance) {
            best_start = index;
        }
    }
    Ok(MultiStartResult { best_start, runs })
}

/// Whether a point (value, violation) is better than another: feasible points before infeasible ones, then by value
/// or violation.
fn before(one: (f64, f64), other: (f64, f64), tolerance: f64) -> bool {
    match (one.1 <= tolerance, other.1 <= tolerance) {
        (true, true) => one.0 < other.0,
        (false, false) => one.1 < other.1,
        (feasible, _) => feasible,
    }
}
