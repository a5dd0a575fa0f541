//! Access to inertial parameters: of one model for all lanes, or of a different robot in every lane.

use dynident_lanes::Scalar;
use dynident_model::{JointStep, Vec3};

pub(crate) trait Bodies<T: Scalar>: Copy {
    /// See [`JointStep::mass`].
    fn mass(self, index: usize) -> T;
    /// See [`JointStep::first`].
    fn first(self, index: usize) -> Vec3<T>;
    /// See [`JointStep::second`].
    fn second(self, index: usize) -> [T; 6];
    /// See [`JointStep::subtree_mass`].
    fn subtree_mass(self, index: usize) -> T;
    /// Whether [`subtree_mass`](Self::subtree_mass) is always zero, so that its products can be skipped.
    fn is_massless(self, index: usize) -> bool;
}

impl<T: Scalar> Bodies<T> for &[JointStep] {
    #[inline(always)]
    fn mass(self, index: usize) -> T {
        T::splat(self[index].mass)
    }
    #[inline(always)]
    fn first(self, index: usize) -> Vec3<T> {
        self[index].first.splat()
    }
    #[inline(always)]
    fn second(self, index: usize) -> [T; 6] {
        self[index].second.map(T::splat)
    }
    #[inline(always)]
    fn subtree_mass(self, index: usize) -> T {
        T::splat(self[index].subtree_mass)
    }
    #[inline(always)]
    fn is_massless(self, index: usize) -> bool {
        self[index].subtree_mass == 0.0
    }
}
