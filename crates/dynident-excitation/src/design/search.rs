//! The search on the coarse grid: random starts, then rounds of restarts around the best.

use super::clear_starts::Starts;
use super::effort::Effort;
use super::restarts::Neighbourhood;
use super::rounds::{Candidate, RoundEnd, Rounds, Worth};
use super::run::DesignRun;
use crate::optimisers::OptimiserError;
use dynident_model::sample::Random;

/// Share of the search's time after which the start that is ahead goes on alone.
const RACE_SHARE: f64 = 0.55;

/// Violation on the search's samples that a polish removes in some evaluations.
const INSIDE: f64 = 1e-4;

/// Rounds whose best is not followed to its end where [`MANY_ROUNDS`] come.
const UNFOLLOWED_ROUNDS: usize = 2;
const MANY_ROUNDS: usize = 8;

/// Name of the round that draws random starts.
const STARTS: &str = "starts";

/// The best motion of all rounds of the search, by the sharpest criterion that was reached.
pub(super) fn searched(run: &DesignRun<'_>) -> Result<Candidate, OptimiserError> {
    let DesignRun { task, settings, interruption, .. } = run;
    let effort = Effort::of(task, settings, run.coarse.len());
    let rounds = Rounds::new(task, &run.coarse, run.logged.len(), true);
    let no_more_starts = || interruption.reported(STARTS, f64::INFINITY, 0.0) || interruption.search_is_late();
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
            stop: &|value, violation| interruption.reported(name, value, violation) || interruption.search_is_late(),
            race_is_over: &|| interruption.is_past(RACE_SHARE * interruption.search_share()),
        };
        let each = if around.is_some() { effort.evaluations_per_restart } else { effort.evaluations_per_start };
        let starts = around.unwrap_or_else(|| random_starts.several(effort.starts, &mut random, &no_more_starts));
        let worth = worth(run, &neighbourhood, &effort, round);
        let found = rounds.run(criterion, &margins, &starts, each, worth, end)?;
        interruption.count(found.evaluations);
        // Scores of another criterion are no measure, but a descent that was cut short may lie far outside.
        let sharper = round < task.criteria.len() && !interruption.search_is_over();
        neighbourhood.take(&found.best, rounds.same(criterion), sharper);
        neighbourhood = neighbourhood.left_when_stale(effort.rounds - round);
        if sharper || best.as_ref().is_none_or(|best| found.best.score < best.score) {
            interruption.set_inside(found.best.violation <= INSIDE);
            best = Some(found.best);
        }
        if interruption.search_is_over() {
            break;
        }
    }
    best.ok_or(OptimiserError::Start)
}

/// Which starts of a round are followed to their end.
fn worth(run: &DesignRun<'_>, neighbourhood: &Neighbourhood, effort: &Effort, round: usize) -> Worth {
    match neighbourhood.score() {
        // Restarts near the best motion find a better one sooner than this search converges.
        _ if round < UNFOLLOWED_ROUNDS && effort.rounds >= MANY_ROUNDS => Worth::Never,
        Some(score) if round >= run.task.criteria.len() => Worth::IfBelow(score),
        _ => Worth::Always,
    }
}
