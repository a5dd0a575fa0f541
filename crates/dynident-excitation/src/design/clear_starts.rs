//! Random starts that stay clear of floor, column and other links.
//!
//! A descent shrinks what a motion uses too much of, but it does not lead an arm around an obstacle that it passes
//! through: in the middle of a column there is no way out that begins downhill. So starts are drawn on the right side:
//! a posture that keeps the places, and a motion in ranges narrowed about it until the whole motion does.

use super::{DesignTask, ranges};
use crate::limits::LimitWorkspace;
use crate::motion::Motion;
use crate::optimisers::AugmentedLagrangianState;
use dynident_model::sample::Random;

/// Postures tried, and narrowings of the ranges about each.
const POSTURES: usize = 24;
const NARROWINGS: usize = 8;

/// A motion counts as clear although it breaks places by so much: a descent leads it back.
const NEARLY: f64 = 0.02;

/// Draws starts of one task.
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
    /// Starts seen at `times`.
    pub(super) fn new(task: &'a DesignTask<'a>, times: &'a [f64]) -> Self {
        let (positions, speeds) = ranges(task.limits);
        let mut workspace = task.limits.workspace();
        workspace.sweep();
        Self { task, times, positions, speeds, workspace, motion: Motion::default(), values: Vec::new() }
    }

    /// Draws `count` starts; after `stop` is true it draws no more, and returns at least one.
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

    /// The next start: the family's own where no places are limited, else the clearest of those tried, the first that
    /// is clear enough.
    fn next(&mut self, random: &mut Random, stop: &dyn Fn() -> bool) -> Vec<f64> {
        let mut best = self.task.family.random(&self.positions, &self.speeds, random);
        if !self.task.limits.has_places() {
            return best;
        }
        let mut least = self.broken_places(&best);
        for _ in 0..POSTURES {
            if least <= NEARLY || stop() {
                break;
            }
            let posture: Vec<f64> = self.positions.iter().map(|[low, high]| random.uniform(*low, *high)).collect();
            if self.broken_by_posture(&posture) > 0.0 {
                continue;
            }
            let mut shares = vec![1.0; posture.len()];
            for _ in 0..NARROWINGS {
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
                if least <= NEARLY || stop() {
                    break;
                }
                // Not all joints alike: which of them lead into the obstacle is not known.
                for share in &mut shares {
                    *share *= random.uniform(0.4, 1.0);
                }
            }
        }
        best
    }

    /// Largest value of a row that limits places.
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

/// The part of a range about a position that is `share` of it.
fn about(range: [f64; 2], position: f64, share: f64) -> [f64; 2] {
    let [low, high] = range;
    let half = 0.5 * share * (high - low);
    let middle = position.max(low + half).min(high - half);
    [middle - half, middle + half]
}
