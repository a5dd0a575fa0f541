//! The design itself: the best trajectory of a family by a criterion, inside all limits.
//!
//! Many random starts, each an augmented-Lagrangian descent with exact gradients: parameters → motion → regressor and
//! limits, and one reverse sweep back. Rounds follow one another (random starts on a coarse grid, restarts around the
//! best, a polish on the fine grid), each within an evaluation budget, so that the result depends on the seed alone; a
//! deadline only ends it early, with the best feasible trajectory so far.

pub(crate) mod assess;
mod clear_starts;
mod column_units;
mod effort;
mod envelope;
mod interruption;
mod metric;
mod problem;
mod restarts;
mod restoration;
mod rounds;
mod shrunk;
mod single_change;
mod way_inside;

use crate::criteria::Criterion;
use crate::family::Family;
use crate::limits::LimitSet;
use crate::optimisers::OptimiserError;
use assess::{Assessment, assess};
use clear_starts::Starts;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use dynident_dynamics::PanelLayout;
use dynident_model::sample::Random;
use effort::{Effort, most_of_polishes};
use interruption::Interruption;
use nalgebra::DMatrix;
use restarts::Neighbourhood;
use restoration::restored;
use rounds::{Candidate, POLISHED, Rounds, Worth};
use serde::{Deserialize, Serialize};
use shrunk::shrunk;
pub use single_change::single_changes;
use std::time::Instant;
use way_inside::way_inside;

/// How much is searched, and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DesignSettings {
    /// Random starts of the first round. Default 8, for condition numbers 4, with 24 or more numbers a joint 2; fewer
    /// for a robot so large that the search would else take more than about a minute of a core: unless one of this,
    /// `rounds`, `evaluations_per_start` and `time_limit_s` is given, it gets less of everything.
    pub starts: Option<usize>,
    /// Rounds of restarts around the best, of half as many starts and two at least. Default 1, for condition numbers
    /// 36, with 24 or more numbers a joint 8.
    pub rounds: Option<usize>,
    /// Evaluations of one start or restart at most. Default 1,000, for condition numbers 600 and 500, with 24 or more
    /// numbers a joint 2,000.
    pub evaluations_per_start: Option<usize>,
    /// Evaluations of one polish at most (up to six, while something is broken between samples). Default 1,000.
    pub polish_evaluations: usize,
    /// Samples of the search grid. Default 96 (for condition numbers and families that are linear in their numbers 64),
    /// at least five per free number of a joint, for families that move fast, and 12.5 a second where places are
    /// limited, so that the ways between samples, on which columns are looked for, are nearly straight.
    pub search_samples: Option<usize>,
    /// Rate at which the robot will be logged, Hz: every sample counts for the information. Default 100.
    pub rate_hz: f64,
    /// Stop after so many seconds with the best so far; none by default. The result then depends on the computer.
    pub time_limit_s: Option<f64>,
    /// Seed of the random starts. Default 1.
    pub seed: u64,
}

impl Default for DesignSettings {
    fn default() -> Self {
        Self {
            starts: None,
            rounds: None,
            evaluations_per_start: None,
            polish_evaluations: 1_000,
            search_samples: None,
            rate_hz: 100.0,
            time_limit_s: None,
            seed: 1,
        }
    }
}

impl DesignSettings {
    /// Samples of the search grid.
    pub(crate) fn search_grid(&self, task: &DesignTask<'_>) -> usize {
        let (family, limits) = (task.family, task.limits);
        let many_optima = task.criteria.last().is_some_and(|criterion| criterion.has_many_optima());
        let least = if many_optima && family.is_linear() { LEAST_SAMPLES_OF_MANY } else { LEAST_SAMPLES };
        let each = family.parameters() / family.joints().max(1);
        let of_place = if limits.has_places() {
            (limits.model().own_scale().round_hertz(PLACE_RATE_HZ) * family.duration_s()) as usize
        } else {
            0
        };
        // Whole registers.
        self.search_samples.unwrap_or_else(|| least.max((5 * each).max(of_place).next_multiple_of(16))).max(8)
    }
}

/// Samples of the search grid at least; where many descents are needed and each joint is a sum of few functions, whose
/// extremes are then seen to some hundredths, fewer.
const LEAST_SAMPLES: usize = 96;
const LEAST_SAMPLES_OF_MANY: usize = 64;

/// Rate of the search grid where places are limited, Hz of a usual arm.
const PLACE_RATE_HZ: f64 = 12.5;

/// What is to be designed.
#[derive(Clone, Copy)]
pub struct DesignTask<'a> {
    /// The family.
    pub family: &'a dyn Family,
    /// Criteria one after another: each round goes on with the next (a smooth norm first, then a sharp one); the last
    /// stays.
    pub criteria: &'a [&'a dyn Criterion],
    /// Everything that must be kept.
    pub limits: &'a LimitSet,
    /// The columns to be identified: base columns, terms included.
    pub layout: &'a PanelLayout,
    /// Standard deviation of each joint's torque, Nm (N).
    pub torque_std_nm: &'a [f64],
    /// Information before the motion.
    pub prior: Option<&'a DMatrix<f64>>,
}

/// The best trajectory found.
#[derive(Clone, Debug)]
pub struct Design {
    /// Parameters of the family.
    pub parameters: Vec<f64>,
    /// Information of the trajectory, every logged sample counted.
    pub information: DMatrix<f64>,
    /// The last criterion's figure.
    pub figure: Option<f64>,
    /// Largest `ratio - 1` of any limit, refined between samples: not positive for a feasible trajectory.
    pub violation: f64,
    /// Evaluations of cost and gradient.
    pub evaluations: usize,
    /// Wall seconds.
    pub seconds: f64,
}

/// How far a design has come.
#[derive(Clone, Copy, Debug)]
pub struct DesignProgress {
    /// Name of the round.
    pub round: &'static str,
    /// Best value of the round's criterion in its smooth form; infinite before the first evaluation.
    pub value: f64,
    /// Largest violation there.
    pub violation: f64,
    /// Evaluations so far.
    pub evaluations: u64,
}

/// Searches. `watch` is asked after every evaluation, from any thread, and may end the search: the best so far is then
/// still led inside the limits, for 0.5 s at most.
///
/// # Errors
/// If settings are out of range or no start can be evaluated at all.
pub fn design(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Design, OptimiserError> {
    let begun = Instant::now();
    timed(task, settings, watch, &|| begun.elapsed().as_secs_f64())
}

/// [`design()`] with the seconds since its beginning from a clock of the caller's.
fn timed(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
    elapsed_s: &(dyn Fn() -> f64 + Sync),
) -> Result<Design, OptimiserError> {
    let last = *task.criteria.last().ok_or(OptimiserError::Start)?;
    // Searches end early enough that what was found can be polished and taken back inside the limits in time: what
    // keeps them already needs little of it.
    let later = |share: f64| settings.time_limit_s.is_some_and(|limit| elapsed_s() > share * limit);
    let inside = AtomicBool::new(false);
    let evaluations = AtomicU64::new(0);
    // What the way back inside takes is known once some evaluations have been counted.
    let search_share = || match (settings.time_limit_s, evaluations.load(Ordering::Relaxed)) {
        _ if inside.load(Ordering::Relaxed) => SEARCH_SHARE_INSIDE,
        (Some(limit), done) if done > 0 => {
            let each = elapsed_s() * rayon::current_num_threads() as f64 / done as f64;
            // On twice the samples.
            let back = 2.0 * (2 * LAST_EVALUATIONS) as f64 * each;
            (POLISH_SHARE - back / limit).clamp(SEARCH_SHARE, SEARCH_SHARE_INSIDE)
        }
        _ => SEARCH_SHARE,
    };
    let late = || later(search_share());
    let logged = grid(task.family.duration_s(), (task.family.duration_s() * settings.rate_hz).round() as usize + 1);
    let coarse = grid(task.family.duration_s(), settings.search_grid(task));
    let effort = Effort::of(task, settings, coarse.len());
    let rounds = Rounds::new(task, &coarse, logged.len(), true);
    let interruption = Interruption::new(&watch, elapsed_s, &evaluations);
    let over = || interruption.is_ended() || late();
    let watch = |round: &'static str| {
        let interruption = &interruption;
        move |value: f64, violation: f64| interruption.reported(round, value, violation)
    };
    let overdue = || interruption.is_overdue();
    let no_more_starts = || interruption.reported(STARTS, f64::INFINITY, 0.0) || late();
    // Rounds of searches from random starts, then around the best.
    let mut random = Random::new(settings.seed);
    let mut random_starts = Starts::new(task, &coarse);
    let mut margins = vec![0.0; task.limits.constraints().len()];
    let mut best: Option<Candidate> = None;
    let mut neighbourhood = Neighbourhood::of_search(effort.rounds);
    for round in 0..=effort.rounds {
        let criterion = task.criteria[round.min(task.criteria.len() - 1)];
        let around =
            neighbourhood.starts(round.saturating_sub(1), task.family.joints(), effort.restarts(), &mut random);
        let name = if around.is_some() { "restart" } else { "search" };
        let watch = watch(name);
        let stop = |value, violation| watch(value, violation) || late();
        let race_is_over = || later(RACE_SHARE * search_share());
        let each = if around.is_some() { effort.evaluations_per_restart } else { effort.evaluations_per_start };
        let starts = around.unwrap_or_else(|| random_starts.several(effort.starts, &mut random, &no_more_starts));
        let worth = match neighbourhood.score() {
            // Restarts around the best find a better one sooner than it comes to its own end.
            _ if round < UNFOLLOWED_ROUNDS && effort.rounds >= MANY_ROUNDS => Worth::Never,
            Some(score) if round >= task.criteria.len() => Worth::IfBelow(score),
            _ => Worth::Always,
        };
        let found = rounds.run(criterion, &margins, &starts, each, worth, (stop, race_is_over))?;
        evaluations.fetch_add(found.evaluations as u64, Ordering::Relaxed);
        // Scores of another criterion are no measure, but a descent that was cut short may lie far outside.
        let sharper = round < task.criteria.len() && !over();
        neighbourhood.take(&found.best, rounds.same(criterion), sharper);
        neighbourhood = neighbourhood.left_when_stale(effort.rounds - round);
        if sharper || best.as_ref().is_none_or(|best| found.best.score < best.score) {
            inside.store(found.best.violation <= INSIDE, Ordering::Relaxed);
            best = Some(found.best);
        }
        if over() {
            break;
        }
    }
    // The polish on a finer grid, again with tighter limits while something is broken between its samples. What is kept
    // is the best trajectory whose limits were found kept everywhere, the search's own best included; only if there is
    // none, the least broken one.
    let criterion = last;
    let fine = grid(task.family.duration_s(), 2 * coarse.len() - 1);
    let rounds = Rounds::new(task, &fine, logged.len(), true);
    let best = best.ok_or(OptimiserError::Start)?;
    let mut state = best.state.on_twice_the_samples(coarse.len());
    let (mut kept, mut values) = assess(task, criterion, state.x.clone(), &fine, &logged);
    if interruption.is_ended() {
        let (seen, of_seen) = assess(task, criterion, best.feasible.clone(), &fine, &logged);
        if seen.better_than(&kept) {
            (kept, values) = (seen, of_seen);
        }
    }
    // One more, short, after the watcher has ended the search, where its best is outside the limits.
    let mut last_ways = 1;
    // What the last polish left, where it is outside.
    let mut outside = None;
    let mut left = most_of_polishes(task, settings, fine.len());
    for _ in 0..POLISHES {
        if interruption.is_ended() {
            if kept.violation <= 0.0 || last_ways == 0 {
                break;
            }
            last_ways -= 1;
        }
        // A search that was ended still comes back inside the limits: some tenths of a second.
        let ended = over();
        // Half of what is left, so that something is left for what is broken between samples.
        let most = match (interruption.is_ended(), ended) {
            (true, _) => EVALUATIONS_AFTER_END,
            (false, true) => LAST_EVALUATIONS,
            (false, false) => settings.polish_evaluations,
        };
        let budget = most.min(left.div_ceil(2).max(1));
        let report = watch("polish");
        let stop = |value, violation| (report(value, violation) && !ended) || later(POLISH_SHARE) || overdue();
        let found = rounds.polish(criterion, &margins, state, budget, stop)?;
        evaluations.fetch_add(found.evaluations as u64, Ordering::Relaxed);
        left = left.saturating_sub(found.evaluations);
        state = found.best.state;
        // The last iterate, and the best that kept the limits on the samples.
        let (ended, worst) = assess(task, criterion, state.x.clone(), &fine, &logged);
        let (polished, of_polished) = assess(task, criterion, found.best.feasible, &fine, &logged);
        let whole = ended.violation <= 0.0;
        outside = (!whole).then(|| (ended.clone(), worst.clone()));
        for (candidate, of) in [(ended, &worst), (polished, &of_polished)] {
            if candidate.better_than(&kept) {
                kept = candidate;
                values.clone_from(of);
            }
        }
        if whole || later(POLISH_SHARE) {
            break;
        }
        // A hair outside is made smaller by as much, if that costs next to nothing.
        if let Some((ended, worst)) = outside.as_ref().filter(|(ended, _)| ended.violation < HAIR_OUTSIDE)
            && let Some(smaller) = shrunk(task, criterion, ended, worst, [&fine, &logged], &overdue)
            && loss(criterion, ended, &smaller) < LEAST_LOSS * criterion.scale(task.layout.columns().len())
        {
            outside = None;
            if smaller.better_than(&kept) {
                kept = smaller;
            }
            break;
        }
        for (margin, c) in margins.iter_mut().zip(&worst) {
            // A little more than what is broken, and a hair for the optimiser's own tolerance.
            *margin += if *c > 0.0 { 1.2 * c + 2.0 * POLISHED } else { 0.0 };
        }
    }
    // What still breaks a limit is taken back inside: made smaller, or a hair towards a motion that the search saw keep
    // all, else by a search for the limits alone. The first two are also done where the search was ended, as far as
    // time allows.
    let broken = (kept.violation > 0.0).then(|| (kept.clone(), values));
    for (outside, worst) in outside.iter().chain(&broken) {
        if let Some(smaller) = shrunk(task, criterion, outside, worst, [&fine, &logged], &overdue)
            && smaller.better_than(&kept)
        {
            kept = smaller;
        }
    }
    if kept.violation > 0.0 && !overdue() {
        let (inside, _) = assess(task, criterion, best.feasible, &fine, &logged);
        if let Some(between) = way_inside(task, criterion, &kept, &inside, [&fine, &logged], &overdue) {
            kept = between;
        }
    }
    if kept.violation > 0.0 && !interruption.is_ended() && !later(RESTORATION_SHARE) {
        let stop = |value, violation| watch("restoration")(value, violation) || later(RESTORATION_SHARE);
        let used;
        (kept, used) = restored(task, settings, kept, [&fine, &logged], &stop)?;
        evaluations.fetch_add(used as u64, Ordering::Relaxed);
    }
    Ok(Design {
        figure: kept.figure,
        information: kept.information,
        violation: kept.violation,
        parameters: kept.parameters,
        evaluations: evaluations.load(Ordering::Relaxed) as usize,
        seconds: elapsed_s(),
    })
}

/// Shares of the time limit after which searches, polishes and the way back inside the limits end; the rest is for the
/// check. A search whose best lies outside still ends in time for two short polishes, after the first share at least.
const SEARCH_SHARE: f64 = 0.7;
const SEARCH_SHARE_INSIDE: f64 = 0.8;
const POLISH_SHARE: f64 = 0.88;
const RESTORATION_SHARE: f64 = 0.94;

/// Share of the search's time after which the start that is ahead goes on alone.
const RACE_SHARE: f64 = 0.55;

/// Violation on the search's samples that a polish mends in some evaluations.
const INSIDE: f64 = 1e-4;

/// Rounds whose best is not followed to its end where [`MANY_ROUNDS`] come.
const UNFOLLOWED_ROUNDS: usize = 2;
const MANY_ROUNDS: usize = 8;

/// Violation between samples after a polish that is not worth another one, where the motion made smaller loses less
/// than the second of these, in the criterion's scale.
const HAIR_OUTSIDE: f64 = 3e-4;
const LEAST_LOSS: f64 = 1e-3;

/// Name of the round that draws random starts.
const STARTS: &str = "starts";

/// Polishes at most.
const POLISHES: usize = 6;

/// Evaluations of a polish once the time is up: enough to come back inside the limits.
const LAST_EVALUATIONS: usize = 300;
/// The same once the watcher has ended the search; they also end after [`interruption`]'s time.
const EVALUATIONS_AFTER_END: usize = 60;

/// What the smooth criterion of `smaller` is above that of `larger`; infinite where either has none.
fn loss(criterion: &dyn Criterion, larger: &Assessment, smaller: &Assessment) -> f64 {
    let value = |of: &Assessment| criterion.value_and_derivative(&of.information).map(|(value, _)| value);
    value(smaller).zip(value(larger)).map_or(f64::INFINITY, |(smaller, larger)| smaller - larger)
}

/// `count` equal steps from 0 to the duration, both ends included.
pub fn grid(duration_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| duration_s * k as f64 / (count.max(2) - 1) as f64).collect()
}

/// For every parameter the root mean square of its joint's, for the size of noise (joint after joint, as families store
/// them).
fn joint_scales(parameters: &[f64], joints: usize) -> Vec<f64> {
    let per_joint = (parameters.len() / joints.max(1)).max(1);
    let rms = |part: &[f64]| (part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64).sqrt();
    parameters.chunks(per_joint).flat_map(|part| vec![rms(part); part.len()]).collect()
}

/// Position ranges and velocity limits for random starts: the study's where it narrows the description's.
pub(crate) fn ranges(limits: &LimitSet) -> (Vec<[f64; 2]>, Vec<f64>) {
    let free = |joint: &dynident_model::Joint| if joint.turns() { core::f64::consts::PI } else { 0.5 };
    let mut ranges: Vec<[f64; 2]> = limits.model().joints().iter().map(|joint| [-free(joint), free(joint)]).collect();
    let mut speeds = vec![UNKNOWN_SPEED; ranges.len()];
    for band in limits.bands() {
        let middle = limits.constraints()[band.row].middle;
        match band.order {
            0 => {
                let range = &mut ranges[band.joint];
                let [lower, upper] = [middle - band.half, middle + band.half];
                // A range that lies beyond half a turn is taken as it is.
                *range = if lower < range[1] && upper > range[0] {
                    [lower.max(range[0]), upper.min(range[1])]
                } else {
                    [lower, upper]
                };
            }
            1 => speeds[band.joint] = band.half,
            _ => {}
        }
    }
    (ranges, speeds)
}

/// Velocity of random starts where none is limited, rad/s (m/s).
const UNKNOWN_SPEED: f64 = 2.0;
