//! A friction law as one expression over any scalar. Value, regressor column, slope and generated code follow from
//! it.

use super::JointMotion;
use super::candidate::CandidateLaw;
use super::kind::{TermKind, VelocityFunction};
use core::fmt::Debug;
use dynident_lanes::{Dual, Lane, LaneFunction, Real, map_all};

/// A function of velocity over any scalar. Implementations are `#[inline(always)]`, so that lanes of samples are
/// compiled for each processor level.
pub(super) trait VelocityLaw: Debug {
    /// Torque per unit of the parameter at velocity `dq` of its joint; zero for laws that depend on other quantities.
    fn of<S: Real>(&self, _dq: S) -> S {
        S::ZERO
    }
}

struct OnLanes<'a, L>(&'a L);

impl<L: VelocityLaw> LaneFunction for OnLanes<'_, L> {
    #[inline(always)]
    fn of<T: Lane>(&self, dq: T) -> T {
        self.0.of(dq)
    }
}

impl<L: VelocityLaw> VelocityFunction for L {
    fn value(&self, dq: f64) -> f64 {
        self.of(dq)
    }

    fn slope(&self, dq: f64) -> f64 {
        self.of(Dual::variable(dq)).derivative
    }

    fn fill(&self, joint: usize, motion: &JointMotion<'_>, out: &mut [f64]) {
        map_all(motion.dq_of(joint), out, &OnLanes(self));
    }
}

/// Part of a term kind that depends on the scalar type, and constants of the kind.
pub(super) trait Law: TermKind + VelocityLaw {
    /// Candidates for the friction selection; empty for kinds that are not selected.
    const CANDIDATES: &'static [CandidateLaw] = &[];

    /// The corresponding entry of [`CANDIDATES`](Self::CANDIDATES).
    fn candidate(&self) -> Option<&'static CandidateLaw> {
        Self::CANDIDATES.first()
    }

    /// Like [`TorqueTerm::torque`](super::TorqueTerm::torque); by default a function of its joint's velocity.
    fn torque<S: Real>(&self, row: usize, dq: &[S]) -> Result<S, &'static str> {
        Ok(self.of(dq[row]))
    }
}
