//! A law of friction: one expression over any scalar. Its value, its column of samples, its slope and generated code
//! come from it.

use super::JointMotion;
use super::candidate::CandidateLaw;
use super::kind::{TermKind, VelocityFunction};
use core::fmt::Debug;
use dynident_lanes::{Dual, Lane, LaneFunction, Real, map_all};

/// A function of a velocity, written once over all scalars. Implementations are marked `#[inline(always)]`, so that
/// lanes of samples are compiled for each processor level.
pub(super) trait VelocityLaw: Debug {
    /// Torque per unit of the parameter at velocity `dq` of its joint; zero for what does not follow it alone.
    fn of<S: Real>(&self, _dq: S) -> S {
        S::ZERO
    }
}

/// A law as a function of lanes.
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

/// Properties of a kind of term in addition to [`TermKind`]: what depends on the scalar, and constants of the kind.
pub(super) trait Law: TermKind + VelocityLaw {
    /// How it takes part when recordings choose a joint's friction; empty where they do not choose it.
    const CANDIDATES: &'static [CandidateLaw] = &[];

    /// Which of [`CANDIDATES`](Self::CANDIDATES) it is.
    fn candidate(&self) -> Option<&'static CandidateLaw> {
        Self::CANDIDATES.first()
    }

    /// As [`TorqueTerm::torque`](super::TorqueTerm::torque): by default that of its joint's velocity.
    fn torque<S: Real>(&self, row: usize, dq: &[S]) -> Result<S, &'static str> {
        Ok(self.of(dq[row]))
    }
}
