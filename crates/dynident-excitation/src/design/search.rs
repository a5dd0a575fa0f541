//! Search on the coarse grid: random starts, then rounds of restarts around the best.

use super::clear_starts::Starts;
use super::effort::Effort;
use super::restarts::Neighbourhood;
use super::rounds::{Candidate, FollowPolicy, RoundEnd, Rounds};
use super::run::DesignRun;
use crate::optimisers::OptimiserError;
use dynident_model::sample::Random;

/// Share of the search's time after which only the best start continues.
const RACE_TIME_SHARE: f64 = 0.55;

/// Violation on the samples of the search that a polish can remove in a few evaluations.
const MAX_POLISHABLE_VIOLATION: f64 = 1e-4;

/// Number of first rounds in which the best start does not run until convergence, in searches with at least
/// [`MANY_ROUNDS`] rounds.
const UNFOLLOWED_ROUNDS: usize = 2;
const MANY_ROUNDS: usize = 8;

const STARTS_ROUND_NAME: &str = "starts";

/// Best motion of all rounds of the search, by the last criterion that was reached.
pub(super) fn searched(run: &DesignRun<'_>) -> Result<Candidate, OptimiserError> {
    let DesignRun { task, settings, interruption, .. } = run;
    let effort = Effort::of(task, settings, run.coarse.len());
    let rounds = Rounds::new(task, &run.coarse, run.logged.len(), true);
    let no_more_starts = || interruption.report(STARTS_ROUND_NAME, f64::INFINITY, 0.0) || interruption.search_is_late();
    let mut random = Random::new(settings.seed);
    let mut random_starts = Starts::new(task, &run.coarse);
    let margins = run.no_margins();
    let mut best: Option<Candidate> = None;
    let mut neighbourhood = Neighbourhood::of_search(effort.rounds);
    for round in 0..=effort.rounds {
        let criterion = task.criteria[round.min(task.criteria.len() - 1)];
        let around =
            neighbourhood.starts(round.saturating_sub(1), task.family.joints(), effort.restarts(), &mut random);
        let name = if around.is_some() { "restart" } else { "search" };
        let end = RoundEnd {
            stop: &|value, violation| interruption.report(name, value, violation) || interruption.search_is_late(),
            race_is_over: &|| interruption.is_past(RACE_TIME_SHARE * interruption.search_share()),
        };
        let each = if around.is_some() { effort.evaluations_per_restart } else { effort.evaluations_per_start };
        let starts = around.unwrap_or_else(|| random_starts.several(effort.starts, &mut random, &no_more_starts));
        let follow_policy = follow_policy(run, &neighbourhood, &effort, round);
        let found = rounds.run(criterion, &margins, &starts, each, follow_policy, end)?;
        interruption.count(found.evaluations);
        // Scores by another criterion are not comparable. But a descent that was ended early may be far outside the
        // limits.
        let sharper = round < task.criteria.len() && !interruption.search_is_over();
        neighbourhood.take(&found.best, rounds.same(criterion), sharper);
        neighbourhood = neighbourhood.replaced_if_stale(effort.rounds - round);
        if sharper || best.as_ref().is_none_or(|best| found.best.score < best.score) {
            interruption.set_inside(found.best.violation <= MAX_POLISHABLE_VIOLATION);
            best = Some(found.best);
        }
        if interruption.search_is_over() {
            break;
        }
    }
    best.ok_or(OptimiserError::Start)
}

fn follow_policy(run: &DesignRun<'_>, neighbourhood: &Neighbourhood, effort: &Effort, round: usize) -> FollowPolicy {
    match neighbourhood.score() {
        // Restarts near the best motion find a better motion sooner than this descent converges.
        _ if round < UNFOLLOWED_ROUNDS && effort.rounds >= MANY_ROUNDS => FollowPolicy::Never,
        Some(score) if round >= run.task.criteria.len() => FollowPolicy::IfBelow(score),
        _ => FollowPolicy::Always,
    }
}
