//! Design by optimisers without derivatives, for comparison: the binary genetic algorithm of *Iterative
//! Identification of Robot Dynamic Parameters Based on Logistic Function*, and CMA-ES. Violated limits add penalties.

use crate::criteria::Criterion;
use crate::design::assess::assess;
use crate::design::{Design, DesignProgress, DesignSettings, DesignTask, DesignWatch, grid, ranges};
use crate::information::Information;
use crate::limits::LimitWorkspace;
use crate::motion::Motion;
use crate::optimisers::{
    BinaryGeneticSettings, CmaEsSettings, Generation, OptimiserError, Progress, binary_genetic, cma_es,
};
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, Ordering};
use dynident_model::sample::Random;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Choice of the optimiser, with its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum DerivativeFree {
    /// [`binary_genetic()`].
    Genetic(BinaryGeneticSettings),
    /// [`cma_es()`].
    CmaEs(CmaEsSettings),
}

/// Fitness penalty per unit of violation; also the penalty of a motion that does not excite every parameter.
const VIOLATION_PENALTY: f64 = 1000.0;

/// Initial margin, as a share of each limit, at the samples of the search, because the motion between samples can
/// exceed them.
const INITIAL_MARGIN: f64 = 0.005;

/// Maximum number of searches; each further search has wider margins.
const MAX_SEARCHES: usize = 3;

const ROUND_NAME: &str = "generations";

/// Number of random starts that determine the search range (box) of the parameters, and the factor by which the range
/// is widened.
const BOX_STARTS: usize = 100;
const BOX_WIDENING: f64 = 1.3;

/// Solves a task of [`design`](crate::design()) without gradients: minimises the [`fitness`](Criterion::fitness) of
/// the last criterion plus 1000 times the sum of the largest violation of each limit.
///
/// The search box is given by the family's bounds if they are finite, otherwise by the range of 100 random starts,
/// widened by 1.3. The search grid, seed and time limit are those of `settings` (the seed in the optimiser's settings
/// is not used). At most three searches run, with wider margins while a limit is violated between samples. The result
/// is the best motion by the check between samples.
///
/// Also returns the [`Generation`]s of the first search (for CMA-ES all three values are the best value so far).
///
/// # Errors
/// If settings are out of range.
pub fn design_without_gradients(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    optimiser: &DerivativeFree,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<(Design, Vec<Generation>), OptimiserError> {
    evolved(task, settings, optimiser, &watch)
}

/// [`design_without_gradients()`], compiled once for all watchers.
fn evolved(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    optimiser: &DerivativeFree,
    watch: &DesignWatch<'_>,
) -> Result<(Design, Vec<Generation>), OptimiserError> {
    let begun = Instant::now();
    let late = || settings.time_limit_s.is_some_and(|limit| begun.elapsed().as_secs_f64() > limit);
    let criterion = task.criteria[task.criteria.len() - 1];
    let times = grid(task.family.duration_s(), settings.search_grid(task));
    let logged = grid(task.family.duration_s(), (task.family.duration_s() * settings.rate_hz).round() as usize + 1);
    let fine = grid(task.family.duration_s(), 2 * times.len() - 1);
    let weight = logged.len() as f64 / times.len() as f64;
    let search_box = search_box(task, settings.seed);
    let mut margins = vec![INITIAL_MARGIN; task.limits.constraints().len()];
    let mut kept = None;
    let (mut history, mut evaluations) = (Vec::new(), 0);
    for search in 0..MAX_SEARCHES {
        let objective = Objective { task, criterion, times: &times, weight, margins: &margins, idle: Mutex::default() };
        let watched = Watched::new(watch, &late, evaluations);
        let seed = settings.seed.wrapping_add(search as u64);
        let found = searched(&objective, &search_box, optimiser, seed, &watched)?;
        evaluations += found.evaluations;
        if search == 0 {
            history = found.history;
        }
        let found = assess(task, criterion, found.best, &fine, &logged);
        let whole = found.violation <= 0.0;
        for (margin, c) in margins.iter_mut().zip(&found.extremes) {
            *margin += 2.0 * c.max(0.0);
        }
        if kept.as_ref().is_none_or(|kept| found.better_than(kept)) {
            kept = Some(found);
        }
        if whole || watched.is_stopped() || late() {
            break;
        }
    }
    let kept = kept.ok_or(OptimiserError::Start)?;
    let designed = Design {
        figure: kept.figure,
        information: kept.information,
        violation: kept.violation,
        parameters: kept.parameters,
        evaluations,
        seconds: begun.elapsed().as_secs_f64(),
    };
    Ok((designed, history))
}

struct Found {
    best: Vec<f64>,
    evaluations: usize,
    history: Vec<Generation>,
}

fn searched(
    objective: &Objective<'_>,
    SearchBox { bounds, start }: &SearchBox,
    optimiser: &DerivativeFree,
    seed: u64,
    watched: &Watched<'_>,
) -> Result<Found, OptimiserError> {
    let fitness = |parameters: &[f64]| if watched.is_ended() { f64::INFINITY } else { objective.fitness(parameters) };
    match optimiser {
        DerivativeFree::Genetic(own) => {
            let own = BinaryGeneticSettings { seed, ..own.clone() };
            let result = binary_genetic(fitness, bounds, &own, &mut |progress| watched.report_generation(progress))?;
            Ok(Found { best: result.best, evaluations: result.evaluations, history: result.history })
        }
        DerivativeFree::CmaEs(own) => {
            let own = CmaEsSettings { seed, ..own.clone() };
            let steps: Vec<f64> = bounds.iter().map(|[lower, upper]| 0.15 * (upper - lower)).collect();
            let mut history = Vec::new();
            let mut hear = |progress: &Progress<'_>| {
                history.push(Generation { best: progress.value, best_so_far: progress.value, mean: progress.value });
                watched.report_generation(progress)
            };
            let result = cma_es(fitness, start, &steps, bounds, &own, &mut hear)?;
            Ok(Found { best: result.best, evaluations: result.evaluations, history })
        }
    }
}

/// Reports the progress of one search to the watcher, from any thread, and stores whether the search was ended.
struct Watched<'a> {
    watch: &'a DesignWatch<'a>,
    late: &'a (dyn Fn() -> bool + Sync),
    before: usize,
    best_so_far: Mutex<f64>,
    stopped: AtomicBool,
}

impl<'a> Watched<'a> {
    fn new(watch: &'a DesignWatch<'a>, late: &'a (dyn Fn() -> bool + Sync), before: usize) -> Self {
        Self { watch, late, before, best_so_far: Mutex::new(f64::INFINITY), stopped: AtomicBool::new(false) }
    }

    fn is_stopped(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Reports a value and the number of evaluations. Returns whether the search was ended, now or before.
    fn report(&self, value: f64, evaluations: usize) -> bool {
        let progress = DesignProgress { round: ROUND_NAME, value, violation: 0.0, evaluations: evaluations as u64 };
        if !self.is_stopped() && ((self.watch)(&progress).is_break() || (self.late)()) {
            self.stopped.store(true, Ordering::Relaxed);
        }
        self.is_stopped()
    }

    fn is_ended(&self) -> bool {
        let value = *self.best_so_far.lock().unwrap_or_else(PoisonError::into_inner);
        self.report(value, self.before)
    }

    fn report_generation(&self, progress: &Progress<'_>) -> ControlFlow<()> {
        *self.best_so_far.lock().unwrap_or_else(PoisonError::into_inner) = progress.value;
        let ended = self.report(progress.value, self.before + progress.evaluations);
        if ended { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

struct SearchBox {
    bounds: Vec<[f64; 2]>,
    start: Vec<f64>,
}

fn search_box(task: &DesignTask<'_>, seed: u64) -> SearchBox {
    let mut random = Random::new(seed);
    let (positions, speeds) = ranges(task.limits);
    let starts: Vec<Vec<f64>> = (0..BOX_STARTS).map(|_| task.family.random(&positions, &speeds, &mut random)).collect();
    let bounds = task.family.bounds().into_iter().enumerate().map(|(parameter, [lower, upper])| {
        let seen = starts.iter().map(|start| start[parameter]);
        let (low, high) = seen.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let (middle, half) = (f64::midpoint(low, high), (BOX_WIDENING * 0.5 * (high - low)).max(1e-6));
        let own = [lower, upper];
        let sized = [middle - half, middle + half];
        let bound = [own[0].max(sized[0]), own[1].min(sized[1])];
        if own[0].is_finite() && own[1].is_finite() { own } else { bound }
    });
    SearchBox { bounds: bounds.collect(), start: starts.into_iter().next().unwrap_or_default() }
}

/// Computes the fitness of parameters, with scratch memory for each concurrent thread.
struct Objective<'a> {
    task: &'a DesignTask<'a>,
    criterion: &'a dyn Criterion,
    times: &'a [f64],
    weight: f64,
    margins: &'a [f64],
    idle: Mutex<Vec<Scratch<'a>>>,
}

struct Scratch<'a> {
    information: Information<'a>,
    workspace: LimitWorkspace,
    motion: Motion,
    values: Vec<f64>,
}

impl Objective<'_> {
    fn fitness(&self, parameters: &[f64]) -> f64 {
        let task = self.task;
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut scratch = idle.unwrap_or_else(|| Scratch {
            information: Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior),
            workspace: task.limits.workspace(),
            motion: Motion::default(),
            values: Vec::new(),
        });
        let Scratch { information, workspace, motion, values } = &mut scratch;
        task.family.motion(parameters, self.times, motion);
        task.limits.values(workspace, motion, values);
        let rows = values.chunks_exact(self.times.len()).zip(self.margins);
        let violation: f64 = rows
            .map(|(row, margin)| {
                row.iter().fold(0.0_f64, |worst, c| if c.is_nan() { f64::INFINITY } else { worst.max(c + margin) })
            })
            .sum();
        let fitness = self.criterion.fitness(&information.of(motion, self.weight)).unwrap_or(VIOLATION_PENALTY);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        fitness + VIOLATION_PENALTY * violation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Family;
    use crate::criteria::DOptimal;
    use crate::families::{Fourier, FourierSettings};
    use crate::limits::{JointLimit, LimitSet, Limits};
    use dynident_dynamics::{BaseParameterSettings, BaseParameters, PanelLayout};
    use dynident_model::sample::planar_2r;

    #[test]
    fn both_find_feasible_motions_that_are_better_than_random_ones_on_any_number_of_threads() {
        let mut random = Random::new(5);
        let arm = planar_2r(1.0, random.body(), random.body());
        let joint = |name: &str| JointLimit {
            joint: name.to_owned(),
            position: Some([-2.0, 2.0]),
            speed: Some(2.0),
            acceleration: Some(6.0),
            ..JointLimit::default()
        };
        let limits = Limits { joints: vec![joint("joint1"), joint("joint2")], ..Limits::default() };
        let set = LimitSet::new(&limits, &arm).unwrap();
        let family = Fourier::new(2, 6.0, &FourierSettings { harmonics: 3, ..FourierSettings::default() }).unwrap();
        let base = BaseParameters::new(&arm, &[], &BaseParameterSettings::default());
        let layout = PanelLayout::new(&arm, base.base_columns());
        let task = DesignTask {
            family: &family,
            criteria: &[&DOptimal],
            limits: &set,
            layout: &layout,
            torque_std_nm: &[1.0, 1.0],
            prior: None,
        };
        let settings = DesignSettings { search_samples: Some(48), ..DesignSettings::default() };
        let genetic = BinaryGeneticSettings { generations: 120, elite: true, ..BinaryGeneticSettings::default() };
        let cma = CmaEsSettings { max_evaluations: 4000, ..CmaEsSettings::default() };
        for (optimiser, generations) in [(DerivativeFree::Genetic(genetic), 120), (DerivativeFree::CmaEs(cma), 1)] {
            let run = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| {
                    design_without_gradients(&task, &settings, &optimiser, |_| ControlFlow::Continue(())).unwrap()
                })
            };
            let (designed, history) = run(1);
            assert!(designed.violation <= 0.0, "{optimiser:?}: {}", designed.violation);
            assert!(history.len() >= generations);
            assert!(history.windows(2).all(|w| w[1].best_so_far <= w[0].best_so_far));
            // The median random start keeps position and velocity limits; a search must improve its determinant by more
            // than a factor e.
            let (positions, speeds) = ranges(&set);
            let logged = grid(6.0, 601);
            let mut figures: Vec<f64> = (0..21)
                .map(|_| {
                    let mut motion = Motion::default();
                    family.motion(&family.random(&positions, &speeds, &mut random), &logged, &mut motion);
                    let d = Information::new(&arm, &layout, &[1.0, 1.0], None).of(&motion, 1.0);
                    DOptimal.figure(&d).unwrap()
                })
                .collect();
            figures.sort_by(f64::total_cmp);
            assert!(designed.figure.unwrap() < figures[10] - 1.0, "{:?} {figures:?}", designed.figure);
            assert_eq!(run(2).0.parameters, designed.parameters);
        }
    }
}
