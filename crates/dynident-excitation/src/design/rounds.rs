//! One round of a search: all starts run partially, then the best of them run until convergence.

use super::DesignTask;
use super::column_units::ColumnUnits;
use super::problem::Problem;
use crate::criteria::Criterion;
use crate::optimisers::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, OptimiserError, multi_start,
};
use core::ops::ControlFlow;

/// First penalty of a limit, as a share of the criterion's scale. It is low, so that a start first finds a good
/// motion slightly outside the limits and then moves inside. On three arms with five harmonics and ten starts each, a
/// first penalty of 0.02 with slow growth gives a log det that is 2 to 4 higher than a first penalty of 2 with fast
/// growth.
const FIRST_PENALTY: f64 = 0.02;
/// First penalty for tasks with place limits. With 0.02 a start moves further into obstacles, and more starts fail
/// (UR10 above a table next to a column).
const FIRST_PENALTY_OF_PLACES: f64 = 0.05;
const PENALTY_GROWTH: f64 = 3.0;
/// Number of evaluations that the slow growth of the penalty needs.
const SLOW_PENALTY_EVALUATIONS: f64 = 1000.0;

/// Steps of a descent between two updates of the multipliers; the L-BFGS memory contains all of them. Condition numbers
/// are sharply curved where eigenvalues coincide: with a memory of twelve a descent takes two to four times as many
/// steps.
const DESCENT_STEPS: usize = 30;

/// Violation, and gradient in units of the criterion's scale, at which a polish ends. With 1e-7 and 1e-8 polishes of
/// the Panda took 1,400 evaluations instead of 350.
pub(super) const POLISH_TOLERANCE: f64 = 1e-6;

/// Violation below which starts can be compared.
const COMPARISON_TOLERANCE: f64 = 3e-3;
/// Share of the evaluations after which starts are compared. They are compared by their value with all limits kept,
/// to first order. For UR10, Panda and iiwa14, 40 starts each, the ranks after 270 to 300 of 700 evaluations
/// correlate with the final ranks by 0.7 to 0.9; after 170 evaluations the correlation is only 0.4 to 0.6.
const PARTIAL_RUN_SHARE: f64 = 0.45;
const MIN_COMPARED_STARTS: usize = 4;
/// One of this many starts runs until convergence.
pub(super) const STARTS_PER_FOLLOWED: usize = 4;
/// [`PARTIAL_RUN_SHARE`] of restarts around a known motion, for a criterion whose starts end close to each other. On
/// the same arms with 24 seeds, log det equals that of complete runs without comparison.
const PARTIAL_RESTART_SHARE: f64 = 0.3;
const MIN_COMPARED_RESTARTS: usize = 4;
const FOLLOWED_RESTARTS: usize = 2;
/// Scores that differ by less than this, in units of the criterion's scale, belong to the same motion.
const SAME_SCORE_TOLERANCE: f64 = 1e-4;
/// Weight of the violation when starts are compared, in units of the criterion's scale.
const VIOLATION_WEIGHT: f64 = 10.0;

/// Returns whether a descent ends after an evaluation with this value and violation; called from any thread.
pub(super) type Stop<'a> = dyn Fn(f64, f64) -> bool + Sync + 'a;

#[derive(Clone, Copy)]
pub(super) struct RoundEnd<'a> {
    pub(super) stop: &'a Stop<'a>,
    /// Ends the partial runs of all starts; the best of them continue.
    pub(super) race_is_over: &'a (dyn Fn() -> bool + Sync),
}

/// Grid of a round, and the number of logged samples that it represents.
pub(super) struct Rounds<'a> {
    task: &'a DesignTask<'a>,
    times: &'a [f64],
    logged: usize,
    shaped: bool,
    units: ColumnUnits,
}

pub(super) struct Candidate {
    pub(super) state: AugmentedLagrangianState,
    pub(super) feasible: Vec<f64>,
    /// Largest violation on the samples at the end of the run.
    pub(super) violation: f64,
    /// Value for comparison: the estimated criterion with all limits kept, plus a penalty for the violation.
    pub(super) score: f64,
}

/// Selects the starts of a round that run until convergence.
#[derive(Clone, Copy)]
pub(super) enum FollowPolicy {
    Always,
    /// Runs the best starts if their score is below this value; other descents would return to a known motion.
    IfBelow(f64),
    Never,
}

pub(super) struct RoundResult {
    pub(super) best: Candidate,
    pub(super) evaluations: usize,
}

impl<'a> Rounds<'a> {
    /// Creates rounds on the samples `times`, which represent `logged` samples; `shaped` enables the curvature of
    /// limits.
    pub(super) fn new(task: &'a DesignTask<'a>, times: &'a [f64], logged: usize, shaped: bool) -> Self {
        let units = ColumnUnits::new(task, times, logged as f64 / times.len() as f64);
        Self { task, times, logged, shaped, units }
    }
}

impl Rounds<'_> {
    /// Runs all starts until limits are nearly kept, then the best of them until convergence, as the policy allows.
    pub(super) fn run(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        starts: &[AugmentedLagrangianState],
        budget: usize,
        policy: FollowPolicy,
        end: RoundEnd<'_>,
    ) -> Result<RoundResult, OptimiserError> {
        let settings = self.descent(criterion, budget, COMPARISON_TOLERANCE, 1e-4);
        let stop_race = |value, violation| (end.stop)(value, violation) || (end.race_is_over)();
        let (ahead, raced) = self.race(criterion, margins, starts, &settings, &stop_race)?;
        let first = self.all(criterion, margins, &ahead, &settings, end.stop)?;
        let mut evaluations = raced + evaluations(&first);
        let mut candidates = self.candidates(criterion, first);
        let better = match policy {
            FollowPolicy::Always => f64::INFINITY,
            FollowPolicy::IfBelow(score) => score - self.same(criterion),
            FollowPolicy::Never => f64::NEG_INFINITY,
        };
        if candidates.first().is_none_or(|best| best.score >= better) {
            let best = candidates.into_iter().next().ok_or(OptimiserError::Start)?;
            return Ok(RoundResult { best, evaluations });
        }
        candidates.truncate(starts.len().div_ceil(STARTS_PER_FOLLOWED));
        let ends: Vec<AugmentedLagrangianState> = candidates.into_iter().map(|candidate| candidate.state).collect();
        let last = self.all(criterion, margins, &ends, &self.descent(criterion, budget, 1e-6, 1e-7), end.stop)?;
        evaluations += self::evaluations(&last);
        let best = self.candidates(criterion, last).into_iter().next().ok_or(OptimiserError::Start)?;
        Ok(RoundResult { best, evaluations })
    }

    /// Runs many starts partially, and returns the best of them and the number of evaluations. Among restarts, the
    /// known best motion always continues. For a criterion with many optima, all restarts are returned, because those
    /// with the best final value often have worse values than others for a long time.
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
            (MIN_COMPARED_STARTS, PARTIAL_RUN_SHARE, new.len().div_ceil(STARTS_PER_FOLLOWED))
        } else {
            (MIN_COMPARED_RESTARTS, PARTIAL_RESTART_SHARE, FOLLOWED_RESTARTS)
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

    pub(super) fn same(&self, criterion: &dyn Criterion) -> f64 {
        SAME_SCORE_TOLERANCE * criterion.scale(self.task.layout.columns().len())
    }

    pub(super) fn polish(
        &self,
        criterion: &dyn Criterion,
        margins: &[f64],
        start: AugmentedLagrangianState,
        budget: usize,
        stop: &Stop<'_>,
    ) -> Result<RoundResult, OptimiserError> {
        let settings = self.descent(criterion, budget, POLISH_TOLERANCE, POLISH_TOLERANCE);
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
        // With few evaluations the penalty starts higher and grows faster.
        let hurry = (SLOW_PENALTY_EVALUATIONS / evaluations.max(1) as f64).max(1.0);
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

    /// Candidates, best first; equal candidates in the order of their starts.
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
    /// The same state for constraints on a grid with an additional sample between each two of `samples`.
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
