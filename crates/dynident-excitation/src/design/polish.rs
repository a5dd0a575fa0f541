//! Polish on the fine grid, and the return inside the limits after it.

use super::assess::Assessment;
use super::effort::polish_budget;
use super::interruption::{EVALUATIONS_AFTER_TIME_LIMIT, POLISH_SHARE};
use super::restoration::restored;
use super::rounds::{POLISH_TOLERANCE, Rounds};
use super::run::DesignRun;
use super::shrunk::shrunk;
use super::way_inside::way_inside;
use crate::criteria::Criterion;
use crate::optimisers::{AugmentedLagrangianState, OptimiserError};

/// Share of the time limit after which the restoration ends; the rest is for the check.
const RESTORATION_SHARE: f64 = 0.94;

const MAX_POLISHES: usize = 6;

/// Number of evaluations of a polish after the watcher has ended the search. The polish also ends after the grace
/// time of [`Interruption`](super::interruption::Interruption).
const EVALUATIONS_AFTER_END: usize = 60;

/// Violation between samples below which the motion is shrunk instead of polished again; also the maximum loss by
/// shrinking, in units of the criterion's scale.
const MAX_SHRINKABLE_VIOLATION: f64 = 3e-4;
const MAX_SHRINK_LOSS: f64 = 1e-3;

pub(super) struct Polished {
    kept: Assessment,
    outside: Option<Assessment>,
}

/// Polishes a motion on the fine grid, again with tighter limits while a limit is violated between its samples.
///
/// Returns the best trajectory that keeps all limits everywhere, including the `feasible` one of the search. If no
/// trajectory keeps them, returns the one with the smallest violation.
pub(super) fn polished(
    run: &DesignRun<'_>,
    mut state: AugmentedLagrangianState,
    feasible: &[f64],
) -> Result<Polished, OptimiserError> {
    let DesignRun { task, interruption, criterion, .. } = run;
    let rounds = Rounds::new(task, &run.fine, run.logged.len(), true);
    let mut margins = run.no_margins();
    let mut kept = run.assess(state.x.clone());
    if interruption.is_ended() {
        keep_better(&mut kept, run.assess(feasible.to_vec()));
    }
    // After the watcher has ended the search, one short polish follows if the best is outside the limits.
    let mut short_polishes_left = 1;
    let mut outside = None;
    let mut left = polish_budget(task, run.settings, run.fine.len());
    for _ in 0..MAX_POLISHES {
        if interruption.is_ended() {
            if kept.violation <= 0.0 || short_polishes_left == 0 {
                break;
            }
            short_polishes_left -= 1;
        }
        let polish = Polish::next(run, left);
        let stop = |value, violation| polish.is_stopped(run, value, violation);
        let found = rounds.polish(*criterion, &margins, state, polish.budget, &stop)?;
        interruption.count(found.evaluations);
        left = left.saturating_sub(found.evaluations);
        state = found.best.state;
        let ended = run.assess(state.x.clone());
        let on_samples = run.assess(found.best.feasible);
        let whole = ended.violation <= 0.0;
        outside = (!whole).then(|| ended.clone());
        keep_better(&mut kept, ended);
        keep_better(&mut kept, on_samples);
        let Some(ended) = outside.as_ref().filter(|_| !interruption.is_past(POLISH_SHARE)) else {
            break;
        };
        if let Some(smaller) = cheaply_shrunk(run, ended) {
            outside = None;
            keep_better(&mut kept, smaller);
            break;
        }
        for (margin, c) in margins.iter_mut().zip(&ended.extremes) {
            // Slightly more than the violation, plus the tolerance of the optimiser.
            *margin += if *c > 0.0 { 1.2 * c + 2.0 * POLISH_TOLERANCE } else { 0.0 };
        }
    }
    Ok(Polished { kept, outside })
}

fn keep_better(kept: &mut Assessment, other: Assessment) {
    if other.better_than(kept) {
        *kept = other;
    }
}

struct Polish {
    budget: usize,
    /// Whether the search had already ended: the polish then only returns inside the limits, within some tenths of a
    /// second.
    after_end: bool,
}

impl Polish {
    fn next(run: &DesignRun<'_>, left: usize) -> Self {
        let after_end = run.interruption.search_is_over();
        let most = match (run.interruption.is_ended(), after_end) {
            (true, _) => EVALUATIONS_AFTER_END,
            (false, true) => EVALUATIONS_AFTER_TIME_LIMIT,
            (false, false) => run.settings.polish_evaluations,
        };
        // Half of the remaining evaluations, so that some are left for limits that are violated between samples.
        Self { budget: most.min(left.div_ceil(2).max(1)), after_end }
    }

    fn is_stopped(&self, run: &DesignRun<'_>, value: f64, violation: f64) -> bool {
        let interruption = &run.interruption;
        (interruption.report("polish", value, violation) && !self.after_end)
            || interruption.is_past(POLISH_SHARE)
            || interruption.is_overdue()
    }
}

/// A motion slightly outside the limits, shrunk until it keeps them, if the loss is small.
fn cheaply_shrunk(run: &DesignRun<'_>, outside: &Assessment) -> Option<Assessment> {
    if outside.violation < MAX_SHRINKABLE_VIOLATION
        && let Some(smaller) = made_smaller(run, outside)
        && loss(run.criterion, outside, &smaller)
            < MAX_SHRINK_LOSS * run.criterion.scale(run.task.layout.columns().len())
    {
        return Some(smaller);
    }
    None
}

/// Does [`shrunk`] on the grids of the run, until the time of the run is over.
fn made_smaller(run: &DesignRun<'_>, outside: &Assessment) -> Option<Assessment> {
    shrunk(run.task, run.criterion, outside, [&run.fine, &run.logged], &|| run.interruption.is_overdue())
}

/// Smooth criterion of `smaller` minus that of `larger`; infinite if one of them is undefined.
fn loss(criterion: &dyn Criterion, larger: &Assessment, smaller: &Assessment) -> f64 {
    let value = |of: &Assessment| criterion.value_and_derivative(&of.information).map(|(value, _)| value);
    value(smaller).zip(value(larger)).map_or(f64::INFINITY, |(smaller, larger)| smaller - larger)
}

/// Moves a polished motion that violates a limit inside the limits: by shrinking, by interpolation towards the
/// `feasible` motion of the search, or by a search for feasibility alone. If the search was ended early, only
/// shrinking and interpolation run, as time allows.
pub(super) fn moved_inside(
    run: &DesignRun<'_>,
    polished: Polished,
    feasible: Vec<f64>,
) -> Result<Assessment, OptimiserError> {
    let DesignRun { task, settings, criterion, interruption, .. } = run;
    let Polished { mut kept, outside } = polished;
    let broken = (kept.violation > 0.0).then(|| kept.clone());
    for outside in outside.iter().chain(&broken) {
        if let Some(smaller) = made_smaller(run, outside) {
            keep_better(&mut kept, smaller);
        }
    }
    let grids: [&[f64]; 2] = [&run.fine, &run.logged];
    if kept.violation > 0.0 && !interruption.is_overdue() {
        let inside = run.assess(feasible);
        if let Some(between) = way_inside(task, *criterion, &kept, &inside, grids, &|| interruption.is_overdue()) {
            kept = between;
        }
    }
    if kept.violation > 0.0 && !interruption.is_ended() && !interruption.is_past(RESTORATION_SHARE) {
        let stop = |value, violation| {
            interruption.report("restoration", value, violation) || interruption.is_past(RESTORATION_SHARE)
        };
        let used;
        (kept, used) = restored(task, settings, kept, grids, &stop)?;
        interruption.count(used);
    }
    Ok(kept)
}
