//! Curvature of the augmented Lagrangian, joint by joint.
//!
//! Limits of a single joint depend only on the parameters of that joint. The curvature of active limits is therefore
//! known (exactly for linear families, to first order for others) and need not be learnt from steps. The curvature of
//! the criterion is approximated by the size of the motion in units of its limits.

use super::DesignTask;
use super::envelope::EnvelopeFactor;
use crate::motion::Motion;
use crate::optimisers::{CurvatureFacts, Step};
use nalgebra::{DMatrix, DVectorView};

/// Approximate Hessian `σ G + C`, one block per joint. `G` is the mean square of the motion in units of its limits,
/// `C` the curvature of the active limits, and `σ` the curvature of the criterion, estimated from the last step.
pub(super) struct Metric {
    size: Vec<DMatrix<f64>>,
    limits: Vec<DMatrix<f64>>,
    factors: Vec<EnvelopeFactor>,
    size_weights: Motion,
    weights: Motion,
    sized: bool,
    share: f64,
    each: usize,
}

impl Metric {
    /// `None` if the joints have different numbers of parameters.
    pub(super) fn new(task: &DesignTask<'_>, times: &[f64]) -> Option<Self> {
        let (family, joints) = (task.family, task.family.joints());
        let each = family.parameters().checked_div(joints)?;
        if each * joints != family.parameters() {
            return None;
        }
        let mut weights = Motion::default();
        weights.reset(joints, times.len());
        for band in task.limits.bands().iter().filter(|band| band.order < 3) {
            let range = weights.of(band.joint);
            weights.arrays_mut()[band.order][range].fill(1.0 / (band.half * band.half * times.len() as f64));
        }
        let blocks = vec![DMatrix::zeros(each, each); joints];
        let size_weights = weights.clone();
        Some(Self {
            size: blocks.clone(),
            limits: blocks,
            factors: Vec::new(),
            size_weights,
            weights,
            share: 0.0,
            each,
            sized: false,
        })
    }

    /// Computes `G` at the given parameters; false if the family does not provide it.
    fn update_size(&mut self, task: &DesignTask<'_>, times: &[f64], at: &[f64]) -> bool {
        for (joint, size) in self.size.iter_mut().enumerate() {
            size.fill(0.0);
            if !task.family.curvature(at, times, joint, &self.size_weights, size) {
                return false;
            }
            // Bounds steps in directions that no limit depends on.
            let floor = 1e-9 * size.trace().max(1e-9) / self.each as f64;
            for k in 0..self.each {
                size[(k, k)] += floor;
            }
        }
        self.sized = true;
        true
    }

    /// Computes the curvature of the limits that are active at the parameters `at`, and `σ` from the last step and
    /// its change of the gradient. At the start, `σ` is chosen such that the first step is a fifth of the motion.
    /// Returns false if the matrix is not positive definite.
    pub(super) fn prepare(
        &mut self,
        task: &DesignTask<'_>,
        times: &[f64],
        at: &[f64],
        known: &CurvatureFacts<'_>,
    ) -> bool {
        let CurvatureFacts { pushing, gradient, free, last } = *known;
        // The size of a linear family is constant; that of another family is computed again whenever the optimiser's
        // memory of steps is reset.
        if (!self.sized || (last.is_none() && !task.family.is_linear())) && !self.update_size(task, times, at) {
            return false;
        }
        let samples = times.len();
        self.weights.reset(task.family.joints(), samples);
        for band in task.limits.bands() {
            let pushing = &pushing[band.row * samples..(band.row + 1) * samples];
            let range = self.weights.of(band.joint);
            let scale = 1.0 / (band.half * band.half);
            for (to, from) in self.weights.arrays_mut()[band.order][range].iter_mut().zip(pushing) {
                *to += from * scale;
            }
        }
        for (joint, limits) in self.limits.iter_mut().enumerate() {
            limits.fill(0.0);
            task.family.curvature(at, times, joint, &self.weights, limits);
        }
        if let Some(Step { by, gradient_change }) = last {
            let whole: f64 = by.iter().zip(gradient_change).map(|(s, y)| s * y).sum();
            let by_limits = self.square(&self.limits, by);
            let share = (whole - by_limits).max(1e-3 * whole) / self.square(&self.size, by);
            self.share = if self.share > 0.0 { share.clamp(0.2 * self.share, 5.0 * self.share) } else { share };
        } else {
            let squared: f64 = (0..self.size.len())
                .map(|joint| {
                    let own = &gradient[joint * self.each..(joint + 1) * self.each];
                    let mut solved = own.to_vec();
                    EnvelopeFactor::new(&self.size[joint]).map_or(0.0, |factor| {
                        factor.solve(&mut solved);
                        own.iter().zip(&solved).map(|(a, b)| a * b).sum()
                    })
                })
                .sum();
            self.share = (squared / self.square(&self.size, at).max(1e-6)).sqrt() / 0.2;
        }
        if !(self.share > 0.0 && self.share.is_finite()) {
            return false;
        }
        self.factors.clear();
        for (size, limits) in self.size.iter().zip(&self.limits) {
            let mut block = size * self.share + limits;
            // A parameter at its bound is decoupled from the others.
            let held = free[self.factors.len() * self.each..].iter().take(self.each).enumerate();
            for (k, _) in held.filter(|(_, free)| !**free) {
                block.row_mut(k).fill(0.0);
                block.column_mut(k).fill(0.0);
                block[(k, k)] = 1.0;
            }
            let Some(factor) = EnvelopeFactor::new(&block) else { return false };
            self.factors.push(factor);
        }
        true
    }

    /// `v ← (σ G + C)⁻¹ v`.
    pub(super) fn divide(&self, vector: &mut [f64]) {
        for (own, factor) in vector.chunks_exact_mut(self.each).zip(&self.factors) {
            factor.solve(own);
        }
    }

    fn square(&self, blocks: &[DMatrix<f64>], v: &[f64]) -> f64 {
        let parts = v.chunks_exact(self.each).zip(blocks);
        parts
            .map(|(own, block)| {
                let own = DVectorView::from_slice(own, self.each);
                own.dot(&(block * own))
            })
            .sum()
    }
}
