//! What every trajectory family offers to criteria, limits and optimisers.

use crate::motion::{Motion, MotionAdjoint};
use dynident_model::sample::Random;
use nalgebra::DMatrix;

/// A family of trajectories of all joints over one duration, with a vector of free parameters.
///
/// Parameters are stored joint after joint unless the family says otherwise. Every family gives q, q̇, q̈ and jerk
/// exactly (no differences), and pulls a cost's derivatives by the motion back to its parameters exactly.
pub trait Family: core::fmt::Debug + Send + Sync {
    /// The family's name in study files and results.
    fn name(&self) -> &'static str;

    /// Number of joints.
    fn joints(&self) -> usize;

    /// Duration in seconds.
    fn duration_s(&self) -> f64;

    /// Number of free parameters, all joints together.
    fn parameters(&self) -> usize;

    /// Lower and upper bound of each parameter that the family itself needs (not the robot's limits); infinite where
    /// there is none.
    fn bounds(&self) -> Vec<[f64; 2]>;

    /// A random start of sensible size for joints with the given position range `[lower, upper]` and velocity limit;
    /// inside [`bounds`](Family::bounds).
    fn random(&self, ranges: &[[f64; 2]], speeds: &[f64], random: &mut Random) -> Vec<f64>;

    /// The motion at `times_s`, within the duration.
    ///
    /// # Panics
    /// If `parameters` has not [`parameters`](Family::parameters) entries.
    fn motion(&self, parameters: &[f64], times_s: &[f64], out: &mut Motion);

    /// Adds to `gradient` the derivative of a cost by the parameters, given its derivatives by the motion at `times_s`.
    ///
    /// # Panics
    /// If lengths differ.
    fn apply_adjoint(&self, parameters: &[f64], times_s: &[f64], adjoint: &MotionAdjoint, gradient: &mut [f64]);

    /// Adds `Σ_s Σ_o w_o(s) b_o(s) b_o(s)ᵀ` of one joint to `out` (square, the joint's parameters), where `b_o` are the
    /// derivatives of that joint's q, q̇, q̈ and jerk by its parameters and `w_o` the numbers of `weights` in the same
    /// arrays. Returns false, with nothing added, if the family does not offer it: optimisers then learn the curvature
    /// of limits step by step.
    ///
    /// Only for families whose joints have parameters of their own, equally many, joint after joint.
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

/// The panic of [`Family::apply_adjoint`].
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
