//! Random starts that keep clear of floor, column and other links.
//!
//! A descent reduces violations, but it does not lead an arm around an obstacle that it passes through: in the middle
//! of a column no direction reduces the violation. The starts are therefore drawn outside obstacles. First a posture
//! is drawn that keeps the place limits, then a motion within ranges that are narrowed around the posture until the
//! whole motion keeps them.

use super::{DesignTask, ranges};
use crate::limits::LimitWorkspace;
use crate::motion::Motion;
use crate::optimisers::AugmentedLagrangianState;
use dynident_model::sample::Random;

const MAX_POSTURES: usize = 24;
const MAX_NARROWINGS: usize = 8;

/// Largest violation of place limits at which a start is accepted; a descent corrects it.
const MAX_START_VIOLATION: f64 = 0.02;

pub(super) struct Starts<'a> {
    task: &'a DesignTask<'a>,
    times: &'a [f64],
    positions: Vec<[f64; 2]>,
    speeds: Vec<f64>,
    workspace: LimitWorkspace,
    motion: Motion,
    values: Vec<f64>,
}

impl<'a> Starts<'a> {
    pub(super) fn new(task: &'a DesignTask<'a>, times: &'a [f64]) -> Self {
        let (positions, speeds) = ranges(task.limits);
        let mut workspace = task.limits.workspace();
        workspace.test_between_samples();
        Self { task, times, positions, speeds, workspace, motion: Motion::default(), values: Vec::new() }
    }

    pub(super) fn several(
        &mut self,
        count: usize,
        random: &mut Random,
        stop: &dyn Fn() -> bool,
    ) -> Vec<AugmentedLagrangianState> {
        let mut starts = Vec::with_capacity(count);
        while starts.len() < count && (starts.is_empty() || !stop()) {
            starts.push(self.next(random, stop).into());
        }
        starts
    }

    /// Returns the next start: the family's random start if there are no place limits, otherwise the first start with
    /// a small enough violation, or the best of those tried.
    fn next(&mut self, random: &mut Random, stop: &dyn Fn() -> bool) -> Vec<f64> {
        let mut best = self.task.family.random(&self.positions, &self.speeds, random);
        if !self.task.limits.has_places() {
            return best;
        }
        let mut least = self.broken_places(&best);
        for _ in 0..MAX_POSTURES {
            if least <= MAX_START_VIOLATION || stop() {
                break;
            }
            let posture: Vec<f64> = self.positions.iter().map(|[low, high]| random.uniform(*low, *high)).collect();
            if self.broken_by_posture(&posture) > 0.0 {
                continue;
            }
            let mut shares = vec![1.0; posture.len()];
            for _ in 0..MAX_NARROWINGS {
                let narrowed: Vec<[f64; 2]> = self
                    .positions
                    .iter()
                    .zip(&posture)
                    .zip(&shares)
                    .map(|((limits, position), share)| about(*limits, *position, *share))
                    .collect();
                let start = self.task.family.random(&narrowed, &self.speeds, random);
                let broken = self.broken_places(&start);
                if broken < least {
                    (best, least) = (start, broken);
                }
                if least <= MAX_START_VIOLATION || stop() {
                    break;
                }
                // Each joint is narrowed by a random factor, because the joint that causes the collision is unknown.
                for share in &mut shares {
                    *share *= random.uniform(0.4, 1.0);
                }
            }
        }
        best
    }

    fn broken_places(&mut self, parameters: &[f64]) -> f64 {
        self.task.family.motion(parameters, self.times, &mut self.motion);
        self.worst()
    }

    fn broken_by_posture(&mut self, posture: &[f64]) -> f64 {
        self.motion.reset(posture.len(), 1);
        self.motion.q.copy_from_slice(posture);
        self.worst()
    }

    fn worst(&mut self) -> f64 {
        self.task.limits.values(&mut self.workspace, &self.motion, &mut self.values);
        let rows = self.task.limits.constraints().iter().zip(self.values.chunks_exact(self.motion.samples));
        rows.filter(|(constraint, _)| constraint.kind.is_place())
            .flat_map(|(_, values)| values)
            .fold(0.0, |worst: f64, value| worst.max(*value))
    }
}

/// The part of a range around a position with `share` of its width.
fn about(range: [f64; 2], position: f64, share: f64) -> [f64; 2] {
    let [low, high] = range;
    let half = 0.5 * share * (high - low);
    let middle = position.max(low + half).min(high - half);
    [middle - half, middle + half]
}
