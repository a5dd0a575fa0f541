//! Interface of the trajectory families.

use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// A family of trajectories of all joints over one duration, with a vector of free parameters.
///
/// Parameters are stored joint after joint unless the family states otherwise. Every family provides q, q̇, q̈ and
/// jerk analytically. It also provides exact derivatives of a cost with respect to its parameters, from derivatives
/// with respect to the motion.
pub trait Family: core::fmt::Debug + Send + Sync {
    /// The family's name in study files and results.
    fn name(&self) -> &'static str;

    /// Number of joints.
    fn joints(&self) -> usize;

    /// Duration in seconds.
    fn duration_s(&self) -> f64;

    /// Number of free parameters of all joints.
    fn parameters(&self) -> usize;

    /// Lower and upper bound of each parameter required by the family (not by the robot); infinite without bound.
    fn bounds(&self) -> Vec<[f64; 2]> {
        vec![[f64::NEG_INFINITY, f64::INFINITY]; self.parameters()]
    }

    /// Random start of suitable size for joints with the given position range `[lower, upper]` and velocity limit,
    /// inside [`bounds`](Family::bounds).
    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64>;

    /// Computes the motion at `times_s`, within the duration.
    ///
    /// # Panics
    /// If `parameters` does not have [`parameters`](Family::parameters) entries.
    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion);

    /// Adds to `gradient` the derivative of a cost with respect to the parameters, given its derivatives with respect
    /// to the motion at `times_s`.
    ///
    /// # Panics
    /// If lengths differ.
    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]);

    /// Adds `Σ_s Σ_o w_o(s) b_o(s) b_o(s)ᵀ` of one joint to `out` (square, with the joint's parameters). `b_o(s)` are
    /// the derivatives of the joint's q, q̇, q̈ and jerk at sample s with respect to its parameters. `w_o(s)` are the
    /// values of `weights` in the same arrays. Returns false and adds nothing if the family does not implement it;
    /// optimisers then estimate the curvature of limits from their steps.
    ///
    /// Only for families whose joints have separate parameters, the same number each, stored joint after joint.
    ///
    /// # Panics
    /// If shapes differ.
    fn curvature(
        &self,
        _parameters: &[f64],
        _times_s: &[f64],
        _joint: usize,
        _weights: &MotionAdjoint,
        _out: &mut DMatrix<f64>,
    ) -> bool {
        false
    }

    /// Whether the motion is linear in the parameters, so that [`curvature`](Family::curvature) does not depend on
    /// them.
    fn is_linear(&self) -> bool {
        false
    }
}

/// Checks the array lengths of [`Family::apply_adjoint`] and panics if they differ.
pub(crate) fn check_shapes(
    family: &impl Family,
    parameters: &[f64],
    times_s: &[f64],
    adjoint: &MotionAdjoint,
    gradient: &[f64],
) {
    let (name, count) = (family.name(), family.parameters());
    assert_eq!((parameters.len(), gradient.len()), (count, count), "parameters and gradient of {name}");
    assert_eq!((adjoint.joints, adjoint.samples), (family.joints(), times_s.len()), "adjoint of {name}");
}
