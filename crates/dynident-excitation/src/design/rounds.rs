//! One round of a search: every start a good part of the way, the best of them to the end.

use super::DesignTask;
use super::column_units::ColumnUnits;
use super::problem::Problem;
use crate::criteria::Criterion;
use crate::optimisers::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, OptimiserError, multi_start,
};
use core::ops::ControlFlow;

/// First penalty of a limit, as a share of the criterion's scale: so low that a start first finds a good motion
/// somewhat outside the limits and is then led inside. Measured on three arms, five harmonics, ten starts each: 0.02
/// with slow growth ends 2 to 4 nats better than 2 with fast growth.
const FIRST_PENALTY: f64 = 0.02;
/// The same where places are limited too: with 0.02 a start strays further into obstacles before it is led back, and
/// more of them are lost there (UR10 over a table beside a column).
const FIRST_PENALTY_OF_PLACES: f64 = 0.05;
const PENALTY_GROWTH: f64 = 3.0;
/// Evaluations that this slow way needs.
const FULL_EVALUATIONS: f64 = 1000.0;

/// Steps of a descent between two updates of the multipliers; all of them are remembered. Condition numbers bend
/// sharply where eigenvalues meet: with twelve remembered a descent takes two to four times as many to its end.
const DESCENT_STEPS: usize = 30;

/// Violation and gradient, in the criterion's scale, at which a polish ends. With a tenth and a hundredth of
/// it polishes of the Panda took 1,400 evaluations in place of 350.
pub(super) const POLISHED: f64 = 1e-6;

/// Violation at which a start is distinguished from others well enough.
const LOOSE: f64 = 3e-3;
/// Share of its evaluations after which a start is compared with others by what it would be with all limits kept, to
/// first order. Of UR10, Panda and iiwa14, 40 starts each, the ranks after 270 to 300 of 700 evaluations correlate with
/// those of the ends by 0.7 to 0.9, after 170 by 0.4 to 0.6.
const RACE: f64 = 0.45;
/// Starts of which it is worth it.
const LEAST_RACING: usize = 4;
/// One in so many starts is followed to the end.
pub(super) const FOLLOWED: usize = 4;
/// [`RACE`] of restarts around a known motion for a criterion whose starts end near each other. Log det of the same
/// arms, 24 seeds: as without a race.
const RACE_OF_RESTARTS: f64 = 0.3;
/// Restarts of which a race is worth it, and how many are followed.
const LEAST_RACING_RESTARTS: usize = 4;
const FOLLOWED_RESTARTS: usize = 2;
/// Scores that differ by less, in the criterion's scale, are the same motion's.
const SAME: f64 = 1e-4;
/// Weight of what is still violated when starts are compared, in the criterion's scale.
const VIOLATION_WEIGHT: f64 = 10.0;

/// Whether a descent ends after an evaluation with this value and violation; called from any thread.
pub(super) type Stop<'a> = dyn Fn(f64, f64) -> bool + Sync + 'a;

/// Conditions that end a round early.
#[derive(Clone, Copy)]
pub(super) struct RoundEnd<'a> {
    /// Ends all descents.
    pub(super) stop: &'a Stop<'a>,
    /// Ends the race of the starts, after which those ahead go on.
    pub(super) race_is_over: &'a (dyn Fn() -> bool + Sync),
}

/// The grid of a round, and the samples that it stands for.
pub(super) struct Rounds<'a> {
    task: &'a DesignTask<'a>,
    times: &'a [f64],
    logged: usize,
    shaped: bool,
    units: ColumnUnits,
}

/// Where a start ended.
pub(super) struct Candidate {
    pub(super) state: AugmentedLagrangianState,
    /// The best point that kept the limits on the samples, or the least violating one.
    pub(super) feasible: Vec<f64>,
    /// Largest violation on the samples there.
    pub(super) violation: f64,
    /// What candidates are compared by: the criterion as it would be with all limits kept, and a penalty for what is
    /// not.
    pub(super) score: f64,
}

/// Which starts of a round are followed to the end.
#[derive(Clone, Copy)]
pub(super) enum Worth {
    /// The best of them.
    Always,
    /// The best of them if their score is below this one: descents that fall back to a known motion end there.
    IfBelow(f64),
    /// None.
    Never,
}

/// The best of a round.
pub(super) struct RoundResult {
    pub(super) best: Candidate,
    pub(super) evaluations: usize,
}

impl<'a> Rounds<'a> {
    /// On the samples `times`, which stand for `logged` ones; `shaped` if the curvature of limits is made use of.
    pub(super) fn new(task: &'a DesignTask<'a>, times: &'a [f64], logged: usize, shaped: bool) -> Self {
        let units = ColumnUnits::new(task, times, logged as f64 / times.len() as f64);
        Self { task, times, logged, shaped, units }
    }
}

impl Rounds<'_> {
    /// Follows all starts until limits are nearly kept, then the best of them, where they are worth it, to the end.
    pub(super) fn run(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        starts: &[AugmentedLagrangianState],
        budget: usize,
        worth: Worth,
        end: RoundEnd<'_>,
    ) -> Result<RoundResult, OptimiserError> {
        let settings = self.descent(criterion, budget, LOOSE, 1e-4);
        let stop_race = |value, violation| (end.stop)(value, violation) || (end.race_is_over)();
        let (ahead, raced) = self.race(criterion, margins, starts, &settings, &stop_race)?;
        let first = self.all(criterion, margins, &ahead, &settings, end.stop)?;
        let mut evaluations = raced + evaluations(&first);
        let mut candidates = self.candidates(criterion, first);
        let better = match worth {
            Worth::Always => f64::INFINITY,
            Worth::IfBelow(score) => score - self.same(criterion),
            Worth::Never => f64::NEG_INFINITY,
        };
        if candidates.first().is_none_or(|best| best.score >= better) {
            let best = candidates.into_iter().next().ok_or(OptimiserError::Start)?;
            return Ok(RoundResult { best, evaluations });
        }
        candidates.truncate(starts.len().div_ceil(FOLLOWED));
        let ends: Vec<AugmentedLagrangianState> = candidates.into_iter().map(|candidate| candidate.state).collect();
        let last = self.all(criterion, margins, &ends, &self.descent(criterion, budget, 1e-6, 1e-7), end.stop)?;
        evaluations += self::evaluations(&last);
        let best = self.candidates(criterion, last).into_iter().next().ok_or(OptimiserError::Start)?;
        Ok(RoundResult { best, evaluations })
    }

    /// Follows many starts a part of the way, and gives those that are ahead, and the evaluations. Of restarts around
    /// the best the best itself goes on beside them. Restarts for a criterion with many optima are given back as they
    /// are: those that end below the best are often behind it for long.
    fn race(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        starts: &[AugmentedLagrangianState],
        settings: &AugmentedLagrangianSettings,
        stop: &Stop<'_>,
    ) -> Result<(Vec<AugmentedLagrangianState>, usize), OptimiserError> {
        let (known, new): (Vec<_>, Vec<_>) = starts.iter().cloned().partition(|start| !start.multipliers.is_empty());
        let (least, share, followed) = if known.is_empty() {
            (LEAST_RACING, RACE, new.len().div_ceil(FOLLOWED))
        } else {
            (LEAST_RACING_RESTARTS, RACE_OF_RESTARTS, FOLLOWED_RESTARTS)
        };
        if new.len() < least || (!known.is_empty() && criterion.has_many_optima()) {
            return Ok((starts.to_vec(), 0));
        }
        let part = (share * settings.max_evaluations as f64).ceil() as usize;
        let settings = AugmentedLagrangianSettings { max_evaluations: part, ..settings.clone() };
        let mut runs = self.all(criterion, margins, &new, &settings, stop)?;
        let evaluations = evaluations(&runs);
        runs.sort_by(|a, b| a.lagrangian.total_cmp(&b.lagrangian));
        runs.truncate(followed);
        let ahead: Vec<_> = known.into_iter().chain(runs.into_iter().map(|run| run.end)).collect();
        if ahead.is_empty() { Err(OptimiserError::Start) } else { Ok((ahead, evaluations)) }
    }

    /// Scores that differ by less are the same motion's.
    pub(super) fn same(&self, criterion: &dyn Criterion) -> f64 {
        SAME * criterion.scale(self.task.layout.columns().len())
    }

    /// Goes on from one point to the end.
    pub(super) fn polish(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        start: AugmentedLagrangianState,
        budget: usize,
        stop: &Stop<'_>,
    ) -> Result<RoundResult, OptimiserError> {
        let settings = self.descent(criterion, budget, POLISHED, POLISHED);
        let runs = self.all(criterion, margins, &[start], &settings, stop)?;
        let evaluations = evaluations(&runs);
        let best = self.candidates(criterion, runs).into_iter().next().ok_or(OptimiserError::Start)?;
        Ok(RoundResult { best, evaluations })
    }

    fn all(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        starts: &[AugmentedLagrangianState],
        settings: &AugmentedLagrangianSettings,
        stop: &Stop<'_>,
    ) -> Result<Vec<AugmentedLagrangianResult>, OptimiserError> {
        let weight = self.logged as f64 / self.times.len() as f64;
        let result = multi_start(
            || Problem::new(self.task, margins, criterion, &self.units, self.times, weight, self.shaped),
            starts,
            settings,
            |progress| {
                if stop(progress.value, progress.violation) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        )?;
        Ok(result.runs.into_iter().flatten().collect())
    }

    fn descent(
        &self,
        criterion: &dyn Criterion,
        evaluations: usize,
        feasibility_tolerance: f64,
        optimality_tolerance: f64,
    ) -> AugmentedLagrangianSettings {
        // With few evaluations there is no time to wander outside.
        let hurry = (FULL_EVALUATIONS / evaluations.max(1) as f64).max(1.0);
        let first = if self.task.limits.has_places() { FIRST_PENALTY_OF_PLACES } else { FIRST_PENALTY };
        AugmentedLagrangianSettings {
            max_evaluations: evaluations,
            max_inner_iterations: DESCENT_STEPS,
            memory: DESCENT_STEPS,
            initial_penalty: Some(first * (hurry * hurry).min(1e3) * criterion.scale(self.task.layout.columns().len())),
            penalty_growth: (PENALTY_GROWTH * hurry).min(10.0),
            feasibility_tolerance,
            optimality_tolerance,
            ..AugmentedLagrangianSettings::default()
        }
    }

    /// The ends, best first; among equals the earlier start.
    fn candidates(&self, criterion: &dyn Criterion, runs: Vec<AugmentedLagrangianResult>) -> Vec<Candidate> {
        let scale = criterion.scale(self.task.layout.columns().len());
        let mut candidates: Vec<Candidate> = runs
            .into_iter()
            .map(|run| Candidate {
                score: if run.lagrangian.is_finite() {
                    run.lagrangian + VIOLATION_WEIGHT * scale * run.end_violation
                } else {
                    f64::INFINITY
                },
                violation: run.violation,
                feasible: run.best,
                state: run.end,
            })
            .collect();
        candidates.sort_by(|a, b| a.score.total_cmp(&b.score));
        candidates
    }
}

fn evaluations(runs: &[AugmentedLagrangianResult]) -> usize {
    runs.iter().map(|run| run.evaluations).sum()
}

impl AugmentedLagrangianState {
    /// The same state for constraints on a grid with a sample between each two of `samples`.
    pub(super) fn on_twice_the_samples(mut self, samples: usize) -> Self {
        if !self.multipliers.is_empty() {
            let fine = 2 * samples - 1;
            let mut multipliers = vec![0.0; self.multipliers.len() / samples * fine];
            for (to, from) in multipliers.chunks_exact_mut(fine).zip(self.multipliers.chunks_exact(samples)) {
                for (to, from) in to.iter_mut().step_by(2).zip(from) {
                    *to = *from;
                }
            }
            self.multipliers = multipliers;
        }
        self
    }
}
