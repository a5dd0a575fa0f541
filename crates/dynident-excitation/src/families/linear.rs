//! Families whose motion is linear in their parameters.

use super::random_start::{grid, scale_and_shift};
use super::sampled_basis::{GridCache, SampledBasis};
use crate::family::{Family, check_shapes};
use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// Basis functions of time B_c(t) of one joint, q(t) = Σ_c p_c B_c(t), of a [`LinearFamily`].
pub trait Basis: core::fmt::Debug + Send + Sync {
    /// Name of the family.
    const NAME: &'static str;

    /// Number of functions, equal to the number of parameters per joint.
    fn columns(&self) -> usize;

    /// Whether joints have different functions; otherwise all use those of joint 0.
    fn differs_by_joint(&self) -> bool {
        false
    }

    /// Computes the value and the first three derivatives of every function at `time_s` for a joint; `out` is
    /// initialised to zero.
    fn row(&self, joint: usize, time_s: f64, out: &mut [[f64; 4]]);

    /// Parameters of the constant motion with value 1.
    fn standing(&self) -> Vec<f64>;

    /// Random shape of arbitrary size.
    fn shape(&self, random: &mut Random) -> Vec<f64> {
        (0..self.columns()).map(|_| random.normal()).collect()
    }
}

/// A family that is linear in its parameters: joint after joint, the weights of its [`Basis`].
///
/// The functions are sampled once per grid of times and stored, so that motion and gradient are two small matrix
/// products. A grid is recognised by its times, so optimisers should use the same grids repeatedly.
#[derive(Clone, Debug)]
pub struct LinearFamily<B> {
    basis: B,
    joints: usize,
    duration_s: f64,
    grids: GridCache,
}

impl<B: Basis> LinearFamily<B> {
    pub(crate) fn of(basis: B, joints: usize, duration_s: f64) -> Self {
        Self { basis, joints, duration_s, grids: GridCache::default() }
    }

    /// The basis functions.
    pub fn basis(&self) -> &B {
        &self.basis
    }

    fn sets(&self) -> usize {
        if self.basis.differs_by_joint() { self.joints } else { 1 }
    }

    /// Calls `with` for the basis on the grid, or for each of the grid's pieces with the index where the piece
    /// begins.
    fn on_grid(&self, times_s: &[f64], with: impl FnMut(&SampledBasis, usize)) {
        let (columns, sets) = (self.basis.columns(), self.sets());
        let sample = |times: &[f64]| {
            SampledBasis::new(columns, sets, times, |joint, time, out| {
                self.basis.row(joint, time.clamp(0.0, self.duration_s), out);
            })
        };
        self.grids.each(columns * sets, times_s, sample, with);
    }
}

impl<B: Basis> Family for LinearFamily<B> {
    fn name(&self) -> &'static str {
        B::NAME
    }

    fn joints(&self) -> usize {
        self.joints
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn parameters(&self) -> usize {
        self.joints * self.basis.columns()
    }

    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64> {
        let mut parameters: Vec<f64> = (0..self.joints).flat_map(|_| self.basis.shape(random)).collect();
        let mut motion = Motion::default();
        self.motion(&parameters, &grid(self.duration_s), &mut motion);
        let standing = self.basis.standing();
        for (joint, own) in parameters.chunks_mut(standing.len()).enumerate() {
            let span = motion.of(joint);
            let [scale, shift] =
                scale_and_shift(&motion.q[span.clone()], &motion.dq[span], ranges[joint], speeds[joint], random);
            for (value, one) in own.iter_mut().zip(&standing) {
                *value = scale * *value + shift * one;
            }
        }
        parameters
    }

    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion) {
        assert_eq!(parameters.len(), self.parameters(), "parameters of {}", B::NAME);
        out.reset(self.joints, times_s.len());
        self.on_grid(times_s, |basis, from| basis.motion(parameters, from, out));
    }

    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]) {
        check_shapes(self, parameters, times_s, adjoint, gradient);
        self.on_grid(times_s, |basis, from| basis.apply_adjoint(from, adjoint, gradient));
    }

    fn is_linear(&self) -> bool {
        true
    }

    fn curvature(
        &self,
        _parameters: &[f64],
        times_s: &[f64],
        joint: usize,
        weights: &MotionAdjoint,
        out: &mut DMatrix<f64>,
    ) -> bool {
        let columns = self.basis.columns();
        assert_eq!(out.shape(), (columns, columns), "curvature of {}", B::NAME);
        assert_eq!((weights.joints, weights.samples), (self.joints, times_s.len()), "weights of {}", B::NAME);
        self.on_grid(times_s, |basis, from| basis.curvature(from, joint, weights, out));
        true
    }
}
