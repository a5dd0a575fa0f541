//! The polish on the fine grid, and the way back inside the limits after it.

use super::assess::Assessment;
use super::effort::most_of_polishes;
use super::interruption::{LAST_EVALUATIONS, POLISH_SHARE};
use super::restoration::restored;
use super::rounds::{POLISHED, Rounds};
use super::run::DesignRun;
use super::shrunk::shrunk;
use super::way_inside::way_inside;
use crate::criteria::Criterion;
use crate::optimisers::{AugmentedLagrangianState, OptimiserError};

/// Share of the time limit after which the restoration ends; the rest is for the check.
const RESTORATION_SHARE: f64 = 0.94;

/// Polishes at most.
const POLISHES: usize = 6;

/// Evaluations of a polish once the watcher has ended the search; it also ends after the time that
/// [`Interruption`](super::interruption::Interruption) gives it.
const EVALUATIONS_AFTER_END: usize = 60;

/// Violation between samples after a polish that is not worth another one, where the motion made smaller loses less
/// than the second of these, in the criterion's scale.
const SLIGHTLY_OUTSIDE: f64 = 3e-4;
const LEAST_LOSS: f64 = 1e-3;

/// The result of the polishes.
pub(super) struct Polished {
    /// The best trajectory by the check between samples.
    kept: Assessment,
    /// The end of the last polish, where it is outside the limits.
    outside: Option<Assessment>,
}

/// Polishes a motion on the fine grid, again with tighter limits while a limit is broken between its samples.
///
/// The best trajectory that keeps all limits everywhere is kept, `feasible` of the search included; the least broken
/// one if none keeps them.
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
    // One more, short, after the watcher has ended the search, where its best is outside the limits.
    let mut last_ways = 1;
    let mut outside = None;
    let mut left = most_of_polishes(task, run.settings, run.fine.len());
    for _ in 0..POLISHES {
        if interruption.is_ended() {
            if kept.violation <= 0.0 || last_ways == 0 {
                break;
            }
            last_ways -= 1;
        }
        let polish = Polish::next(run, left);
        let stop = |value, violation| polish.is_stopped(run, value, violation);
        let found = rounds.polish(*criterion, &margins, state, polish.budget, &stop)?;
        interruption.count(found.evaluations);
        left = left.saturating_sub(found.evaluations);
        state = found.best.state;
        // The last iterate, and the best that kept the limits on the samples.
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
            // A little more than what is broken, and the optimiser's own tolerance.
            *margin += if *c > 0.0 { 1.2 * c + 2.0 * POLISHED } else { 0.0 };
        }
    }
    Ok(Polished { kept, outside })
}

/// Keeps the better of two trajectories.
fn keep_better(kept: &mut Assessment, other: Assessment) {
    if other.better_than(kept) {
        *kept = other;
    }
}

/// How long one polish may take.
struct Polish {
    /// Evaluations at most.
    budget: usize,
    /// Whether the search was over before: the polish then only comes back inside the limits, some tenths of a second.
    after_end: bool,
}

impl Polish {
    /// The next polish, where `left` evaluations are left for all of them.
    fn next(run: &DesignRun<'_>, left: usize) -> Self {
        let after_end = run.interruption.search_is_over();
        let most = match (run.interruption.is_ended(), after_end) {
            (true, _) => EVALUATIONS_AFTER_END,
            (false, true) => LAST_EVALUATIONS,
            (false, false) => run.settings.polish_evaluations,
        };
        // Half of what is left: the rest is for limits that are broken between samples.
        Self { budget: most.min(left.div_ceil(2).max(1)), after_end }
    }

    /// Reports an evaluation; whether the polish ends there.
    fn is_stopped(&self, run: &DesignRun<'_>, value: f64, violation: f64) -> bool {
        let interruption = &run.interruption;
        (interruption.reported("polish", value, violation) && !self.after_end)
            || interruption.is_past(POLISH_SHARE)
            || interruption.is_overdue()
    }
}

/// A motion slightly outside the limits made smaller until it keeps them, if that costs next to nothing.
fn cheaply_shrunk(run: &DesignRun<'_>, outside: &Assessment) -> Option<Assessment> {
    if outside.violation < SLIGHTLY_OUTSIDE
        && let Some(smaller) = made_smaller(run, outside)
        && loss(run.criterion, outside, &smaller) < LEAST_LOSS * run.criterion.scale(run.task.layout.columns().len())
    {
        return Some(smaller);
    }
    None
}

/// [`shrunk`] on the grids of the run, until it is overdue.
fn made_smaller(run: &DesignRun<'_>, outside: &Assessment) -> Option<Assessment> {
    shrunk(run.task, run.criterion, outside, [&run.fine, &run.logged], &|| run.interruption.is_overdue())
}

/// The smooth criterion of `smaller` minus that of `larger`; infinite where one of them is undefined.
fn loss(criterion: &dyn Criterion, larger: &Assessment, smaller: &Assessment) -> f64 {
    let value = |of: &Assessment| criterion.value_and_derivative(&of.information).map(|(value, _)| value);
    value(smaller).zip(value(larger)).map_or(f64::INFINITY, |(smaller, larger)| smaller - larger)
}

/// Takes a polished motion that breaks a limit back inside: made smaller, or moved slightly towards the `feasible` one
/// of the search, else by a search for the limits alone. The first two are also done where the search was ended, as far
/// as time allows.
pub(super) fn taken_inside(
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
            interruption.reported("restoration", value, violation) || interruption.is_past(RESTORATION_SHARE)
        };
        let used;
        (kept, used) = restored(task, settings, kept, grids, &stop)?;
        interruption.count(used);
    }
    Ok(kept)
}
