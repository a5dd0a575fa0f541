//! The design itself: the best trajectory of a family by a criterion, inside all limits.
//!
//! Many random starts, each an augmented-Lagrangian descent with exact gradients: parameters → motion → regressor and limits, and one reverse sweep back. Rounds follow one another
//! (random starts on a coarse grid, restarts around the best, a polish on the fine grid), each within an evaluation budget, so that the result depends on the seed alone; a deadline only
//! ends it early, with the best feasible trajectory so far.

use crate::criteria::Criterion;
use crate::family::Family;
use crate::information::Information;
use crate::limits::{LimitSet, LimitWorkspace, PeakSettings, peaks};
use crate::motion::Motion;
use crate::optimisers::{AugmentedLagrangianSettings, ConstrainedProblem, OptimiserError, multi_start};
use crate::restoration::restored;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicU64, Ordering};
use dynident_dynamics::PanelLayout;
use dynident_model::sample::Random;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// How much is searched, and how finely.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DesignSettings {
    /// Random starts of the first round. Default 12.
    pub starts: usize,
    /// Rounds of restarts around the best. Default 4.
    pub rounds: usize,
    /// Evaluations of one start at most. Default 150.
    pub evaluations_per_start: usize,
    /// Evaluations of one polish at most (up to six, while something is broken between samples). Default 1,000.
    pub polish_evaluations: usize,
    /// Samples of the search grid; give more to families that move faster than ten harmonics. Default 96.
    pub search_samples: usize,
    /// Rate at which the robot will be logged, Hz: every sample counts for the information. Default 100.
    pub rate_hz: f64,
    /// Stop after so many seconds with the best so far; none by default. The result then depends on the machine.
    pub time_limit_s: Option<f64>,
    /// Seed of the random starts. Default 1.
    pub seed: u64,
}

impl Default for DesignSettings {
    fn default() -> Self {
        Self {
            starts: 12,
            rounds: 4,
            evaluations_per_start: 150,
            polish_evaluations: 1_000,
            search_samples: 96,
            rate_hz: 100.0,
            time_limit_s: None,
            seed: 1,
        }
    }
}

/// What is to be designed.
#[derive(Clone, Copy)]
pub struct DesignTask<'a> {
    /// The family.
    pub family: &'a dyn Family,
    /// Criteria one after another: each round goes on with the next (a smooth norm first, then a sharp one); the last stays.
    pub criteria: &'a [&'a dyn Criterion],
    /// Everything that must be kept.
    pub limits: &'a LimitSet,
    /// The columns to be identified: base columns, laws included.
    pub layout: &'a PanelLayout,
    /// Standard deviation of each joint's torque, Nm (N).
    pub torque_std_nm: &'a [f64],
    /// Information before the motion.
    pub prior: Option<&'a DMatrix<f64>>,
}

/// The best trajectory found.
#[derive(Clone, Debug)]
pub struct Designed {
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
    /// Best value of the round's criterion in its smooth form.
    pub value: f64,
    /// Largest violation there.
    pub violation: f64,
    /// Evaluations so far.
    pub evaluations: u64,
}

/// Searches. `watch` hears of every better point, from any thread, and may end the search.
///
/// # Errors
/// If settings are out of range or no start can be evaluated at all.
pub fn design(
    task: &DesignTask<'_>,
    settings: &DesignSettings,
    watch: impl Fn(&DesignProgress) -> ControlFlow<()> + Sync,
) -> Result<Designed, OptimiserError> {
    let begun = Instant::now();
    let late = || settings.time_limit_s.is_some_and(|limit| begun.elapsed().as_secs_f64() > limit);
    let evaluations = AtomicU64::new(0);
    let coarse = grid(task.family.duration_s(), settings.search_samples.max(8));
    let logged = grid(task.family.duration_s(), (task.family.duration_s() * settings.rate_hz).round() as usize + 1);
    let mut random = Random::new(settings.seed);
    let (ranges, speeds) = ranges(task.limits);
    let mut starts: Vec<Vec<f64>> =
        (0..settings.starts.max(1)).map(|_| task.family.random(&ranges, &speeds, &mut random)).collect();
    let mut margins = vec![0.0; task.limits.constraints().len()];
    let mut best: Option<(Vec<f64>, f64, f64)> = None;
    let rounds = settings.rounds + 1;
    for round in 0..rounds {
        let criterion = task.criteria[round.min(task.criteria.len() - 1)];
        let descent = descent(settings.evaluations_per_start);
        let found = run(task, &margins, criterion, &coarse, logged.len(), &starts, &descent, |progress| {
            watch(&DesignProgress {
                round: if round == 0 { "search" } else { "restart" },
                value: progress.0,
                violation: progress.1,
                evaluations: evaluations.load(Ordering::Relaxed),
            })
            .is_break()
                || late()
        })?;
        evaluations.fetch_add(found.evaluations as u64, Ordering::Relaxed);
        keep_better(&mut best, found);
        if late() {
            break;
        }
        let Some((parameters, ..)) = &best else { continue };
        // Around the best, by noise that shrinks: most of a family's good basins lie near each other.
        let size = [0.3, 0.15, 0.08, 0.04][round.min(3)];
        let scales = joint_scales(parameters, task.family.joints());
        starts = (0..settings.starts.max(4) / 2)
            .map(|k| {
                let spread = if k == 0 { 0.0 } else { size };
                parameters.iter().zip(&scales).map(|(p, scale)| p + spread * scale * random.normal()).collect()
            })
            .collect();
    }
    // The polish on a finer grid, again with tighter limits while something is broken between its samples. What is kept is the best trajectory whose limits were found kept everywhere, the
    // search's own best included; only if there is none, the least broken one.
    let criterion = task.criteria[task.criteria.len() - 1];
    let fine = grid(task.family.duration_s(), 2 * coarse.len() - 1);
    let (mut parameters, ..) = best.ok_or(OptimiserError::Start)?;
    let (mut kept, _) = assess(task, criterion, parameters.clone(), &fine, &logged);
    for _ in 0..POLISHES {
        let start = [parameters];
        let budget = descent(if late() { LAST_EVALUATIONS } else { settings.polish_evaluations });
        let found = run(task, &margins, criterion, &fine, logged.len(), &start, &budget, |progress| {
            watch(&DesignProgress {
                round: "polish",
                value: progress.0,
                violation: progress.1,
                evaluations: evaluations.load(Ordering::Relaxed),
            })
            .is_break()
        })?;
        evaluations.fetch_add(found.evaluations as u64, Ordering::Relaxed);
        parameters = found.parameters;
        let (polished, worst) = assess(task, criterion, parameters.clone(), &fine, &logged);
        let whole = polished.violation <= 0.0;
        if polished.better_than(&kept) {
            kept = polished;
        }
        if whole {
            break;
        }
        for (margin, c) in margins.iter_mut().zip(&worst) {
            // Twice what is broken, and a hair for the optimiser's own tolerance.
            *margin += if *c > 0.0 { 2.0 * c + 1e-6 } else { 0.0 };
        }
    }
    // A watch that breaks, like the clock, leaves it at that.
    if kept.violation > 0.0 && !late() {
        let stop = |progress: &DesignProgress| watch(progress).is_break() || late();
        let used;
        (kept, used) = restored(task, settings, kept, [&fine, &logged], &stop)?;
        evaluations.fetch_add(used as u64, Ordering::Relaxed);
    }
    Ok(Designed {
        figure: kept.figure,
        information: kept.information,
        violation: kept.violation,
        parameters: kept.parameters,
        evaluations: evaluations.load(Ordering::Relaxed) as usize,
        seconds: begun.elapsed().as_secs_f64(),
    })
}

/// Polishes at most.
const POLISHES: usize = 6;

/// Evaluations of a polish once the time is up: enough to come back inside the limits.
const LAST_EVALUATIONS: usize = 60;

/// A trajectory judged as it will be used: every logged sample, every limit between samples.
pub(crate) struct Assessed {
    pub(crate) parameters: Vec<f64>,
    pub(crate) figure: Option<f64>,
    pub(crate) information: DMatrix<f64>,
    pub(crate) violation: f64,
}

impl Assessed {
    pub(crate) fn better_than(&self, other: &Self) -> bool {
        match (self.violation <= 0.0, other.violation <= 0.0) {
            (true, true) => self.figure.unwrap_or(f64::INFINITY) < other.figure.unwrap_or(f64::INFINITY),
            (true, false) => true,
            (false, true) => false,
            (false, false) => self.violation < other.violation,
        }
    }
}

/// Judges a trajectory; also gives the largest value of every limit's row.
pub(crate) fn assess(
    task: &DesignTask<'_>,
    criterion: &dyn Criterion,
    parameters: Vec<f64>,
    fine: &[f64],
    logged: &[f64],
) -> (Assessed, Vec<f64>) {
    let mut motion = Motion::default();
    task.family.motion(&parameters, logged, &mut motion);
    let information =
        Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior).of(&motion, 1.0);
    let worst = extremes(task, &parameters, fine);
    let violation = worst.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (Assessed { figure: criterion.figure(&information), parameters, information, violation }, worst)
}

/// `count` equal steps from 0 to the duration, both ends included.
pub fn grid(duration_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| duration_s * k as f64 / (count.max(2) - 1) as f64).collect()
}

pub(crate) fn descent(evaluations: usize) -> AugmentedLagrangianSettings {
    AugmentedLagrangianSettings {
        max_evaluations: evaluations,
        max_inner_iterations: 60,
        feasibility_tolerance: 1e-7,
        // Criteria are logarithms of some hundred: their own size must not end a descent early.
        optimality_tolerance: 1e-8,
        ..AugmentedLagrangianSettings::default()
    }
}

/// For every parameter the root mean square of its joint's, for the size of noise (joint after joint, as families store them).
fn joint_scales(parameters: &[f64], joints: usize) -> Vec<f64> {
    let per_joint = (parameters.len() / joints.max(1)).max(1);
    let rms = |part: &[f64]| (part.iter().map(|p| p * p).sum::<f64>() / part.len() as f64).sqrt();
    parameters.chunks(per_joint).flat_map(|part| vec![rms(part); part.len()]).collect()
}

/// Position ranges and speed limits for random starts.
pub(crate) fn ranges(limits: &LimitSet) -> (Vec<[f64; 2]>, Vec<f64>) {
    let range = |joint: &dynident_model::Joint| {
        let free = if joint.turns() { core::f64::consts::PI } else { 0.5 };
        let lower = joint.limits.lower.unwrap_or(-free).max(-free);
        let upper = joint.limits.upper.unwrap_or(free).min(free);
        [lower.min(upper), upper.max(lower)]
    };
    let joints = limits.model().joints();
    (joints.iter().map(range).collect(), joints.iter().map(|joint| joint.limits.velocity.unwrap_or(2.0)).collect())
}

pub(crate) struct Found {
    pub(crate) parameters: Vec<f64>,
    value: f64,
    pub(crate) violation: f64,
    pub(crate) evaluations: usize,
}

fn keep_better(best: &mut Option<(Vec<f64>, f64, f64)>, found: Found) {
    const FEASIBLE: f64 = 1e-6;
    let better =
        best.as_ref().is_none_or(|(_, value, violation)| match (found.violation <= FEASIBLE, *violation <= FEASIBLE) {
            (true, true) => found.value < *value,
            (true, false) => true,
            (false, true) => false,
            (false, false) => found.violation < *violation,
        });
    if better {
        *best = Some((found.parameters, found.value, found.violation));
    }
}

#[allow(clippy::too_many_arguments, reason = "one round with all that it needs")]
pub(crate) fn run(
    task: &DesignTask<'_>,
    margins: &[f64],
    criterion: &dyn Criterion,
    times: &[f64],
    logged: usize,
    starts: &[Vec<f64>],
    settings: &AugmentedLagrangianSettings,
    stop: impl Fn((f64, f64)) -> bool + Sync,
) -> Result<Found, OptimiserError> {
    let weight = logged as f64 / times.len() as f64;
    let result = multi_start(
        || Problem::new(task, margins, criterion, times, weight),
        starts,
        settings,
        |progress| {
            if stop((progress.value, progress.violation)) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    )?;
    let evaluations = result.evaluations();
    let best = result.best().ok_or(OptimiserError::Start)?;
    Ok(Found { parameters: best.best.clone(), value: best.value, violation: best.violation, evaluations })
}

/// The largest value of every limit's row, refined between samples.
fn extremes(task: &DesignTask<'_>, parameters: &[f64], times: &[f64]) -> Vec<f64> {
    let mut workspace = task.limits.workspace();
    let found = peaks(task.limits, &mut workspace, times, PeakSettings::default(), |times, out| {
        task.family.motion(parameters, times, out);
    });
    found.iter().map(|peak| peak.value).collect()
}

/// Criterion and limits of one trajectory as functions of the family's parameters.
struct Problem<'a> {
    task: &'a DesignTask<'a>,
    /// Added to every value of each row, so that what is kept on samples is kept between them.
    margins: &'a [f64],
    criterion: &'a dyn Criterion,
    times: &'a [f64],
    weight: f64,
    information: Information<'a>,
    workspace: LimitWorkspace,
    parameters: Vec<f64>,
    motion: Motion,
    cotangent: Motion,
    by_information: Option<DMatrix<f64>>,
    values: Vec<f64>,
}

impl<'a> Problem<'a> {
    fn new(
        task: &'a DesignTask<'a>,
        margins: &'a [f64],
        criterion: &'a dyn Criterion,
        times: &'a [f64],
        weight: f64,
    ) -> Self {
        Self {
            information: Information::new(task.limits.model(), task.layout, task.torque_std_nm, task.prior),
            workspace: task.limits.workspace(),
            task,
            margins,
            criterion,
            times,
            weight,
            parameters: Vec::new(),
            motion: Motion::default(),
            cotangent: Motion::default(),
            by_information: None,
            values: Vec::new(),
        }
    }
}

impl ConstrainedProblem for Problem<'_> {
    fn variables(&self) -> usize {
        self.task.family.parameters()
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        self.task.family.bounds()
    }

    fn constraints(&self) -> usize {
        self.task.limits.constraints().len() * self.times.len()
    }

    fn values(&mut self, x: &[f64], constraints: &mut [f64]) -> f64 {
        self.parameters = x.to_vec();
        self.task.family.motion(x, self.times, &mut self.motion);
        self.task.limits.values(&mut self.workspace, &self.motion, &mut self.values);
        for ((to, from), margin) in constraints
            .chunks_exact_mut(self.times.len())
            .zip(self.values.chunks_exact(self.times.len()))
            .zip(self.margins)
        {
            for (to, from) in to.iter_mut().zip(from) {
                *to = from + margin;
            }
        }
        let information = self.information.of(&self.motion, self.weight);
        if let Some((value, derivative)) = self.criterion.value_and_derivative(&information) {
            self.by_information = Some(derivative);
            value
        } else {
            self.by_information = None;
            f64::INFINITY
        }
    }

    fn gradient(&mut self, weights: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        self.cotangent.reset(self.motion.joints, self.motion.samples);
        self.task.limits.pull_back(&mut self.workspace, &self.motion, weights, &mut self.cotangent);
        if let Some(derivative) = &self.by_information {
            self.information.pull_back(&self.motion, self.weight, derivative, &mut self.cotangent);
        }
        self.task.family.pull_back(&self.parameters, self.times, &self.cotangent, gradient);
    }
}
