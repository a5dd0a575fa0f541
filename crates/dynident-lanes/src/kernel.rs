//! Algorithms that run on all lane types.

use crate::lanes::Lane;

/// An algorithm over any lane type. Implementations mark `run`, and everything in its hot path, `#[inline(always)]`,
/// so that the whole body is compiled once for each processor level.
pub trait Kernel {
    /// Result.
    type Output;
    /// Runs on lanes of type `T`.
    fn run<T: Lane>(self) -> Self::Output;
}
