//! **What looks for the best?** Optimisers, one file each: without derivatives ([`binary_genetic()`], [`cma_es()`]),
//! and with exact gradients from many starts (augmented Lagrangian, projected L-BFGS), which
//! [`design()`](crate::design()) runs.
//!
//! All are deterministic by their seed or start, on any number of threads, and anytime: a callback hears the best point
//! so far and can stop them.

mod augmented_lagrangian;
mod binary_genetic;
mod cma_es;
mod multi_start;
mod projected_lbfgs;

#[cfg(test)]
pub(crate) use augmented_lagrangian::AugmentedLagrangianStatus;
pub(crate) use augmented_lagrangian::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, ConstrainedProblem,
    CurvatureFacts, augmented_lagrangian,
};
pub use binary_genetic::{BinaryGeneticResult, BinaryGeneticSettings, Generation, binary_genetic};
pub use cma_es::{CmaEsResult, CmaEsRun, CmaEsSettings, CmaEsStatus, cma_es};
pub(crate) use multi_start::multi_start;
pub(crate) use projected_lbfgs::Step;

use core::ops::ControlFlow;
use rayon::prelude::*;

/// The state of a search, as its callback hears it.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// The best point so far: the feasible one of the lowest objective, or the least infeasible one while none is
    /// feasible.
    pub best: &'a [f64],
    /// Its objective.
    pub value: f64,
    /// The largest violation of a constraint there; zero for optimisers that know bounds only.
    pub violation: f64,
    /// Generations or outer iterations done.
    pub iteration: usize,
    /// Evaluations of the objective done.
    pub evaluations: usize,
}

/// What a search asks after every step: `Break` ends it with the best point so far.
pub type Watch<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + 'a;

/// An objective without derivatives, evaluated from any thread.
type Objective<'a> = dyn Fn(&[f64]) -> f64 + Sync + 'a;

/// What an optimiser cannot start with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimiserError {
    /// A range that holds no number, or is infinite where it must not be.
    #[error(
        "variable {variable}: range {lower} to {upper} cannot be searched; give lower < upper (both finite for the genetic algorithm)"
    )]
    Bounds {
        /// Number of the variable, from 0.
        variable: usize,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A vector of the wrong length.
    #[error("{what} has {found} entries, expected {expected}")]
    Length {
        /// Which vector.
        what: &'static str,
        /// The number that fits.
        expected: usize,
        /// The number given.
        found: usize,
    },
    /// A setting outside its range.
    #[error("setting `{name}` is {value}; it must be {needed}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        needed: &'static str,
    },
    /// Objective or constraints are not finite numbers at the start.
    #[error("the objective or a constraint is not a finite number at the start; start elsewhere")]
    Start,
}

/// Checks one setting; `needed` says in words what `valid` tests.
fn setting(name: &'static str, value: f64, valid: bool, needed: &'static str) -> Result<(), OptimiserError> {
    if valid { Ok(()) } else { Err(OptimiserError::Setting { name, value, needed }) }
}

/// Checks that every range holds more than one number and, if asked, ends.
fn check_bounds(bounds: &[[f64; 2]], finite: bool) -> Result<(), OptimiserError> {
    for (variable, &[lower, upper]) in bounds.iter().enumerate() {
        // False for NaN too.
        let ordered = lower < upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY;
        if !ordered || (finite && !(upper - lower).is_finite()) {
            return Err(OptimiserError::Bounds { variable, lower, upper });
        }
    }
    Ok(())
}

fn check_length(what: &'static str, expected: usize, found: usize) -> Result<(), OptimiserError> {
    if expected == found { Ok(()) } else { Err(OptimiserError::Length { what, expected, found }) }
}

/// The objective of every candidate, in parallel, in the candidates' order; what is not a number counts as infinitely
/// bad.
fn evaluate_all(objective: &Objective<'_>, candidates: &[Vec<f64>]) -> Vec<f64> {
    candidates
        .par_iter()
        .map(|candidate| {
            let value = objective(candidate);
            if value.is_nan() { f64::INFINITY } else { value }
        })
        .collect()
}
