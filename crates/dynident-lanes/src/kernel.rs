//! Work that is written once for all lane types.

use crate::lanes::Lane;

/// Work that can run over any lane type. Implementations mark `run`, and everything it calls in its hot path,
/// `#[inline(always)]`, so that the whole body is compiled once for each processor level.
pub trait Kernel {
    /// What the work returns.
    type Output;
    /// Does the work on lanes of type `T`.
    fn run<T: Lane>(self) -> Self::Output;
}
