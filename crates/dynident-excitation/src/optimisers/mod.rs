//! **Optimisers**, one file each. Without derivatives: [`binary_genetic()`] and [`cma_es()`]. With exact gradients
//! from many starts: augmented Lagrangian with projected L-BFGS, which [`design()`](crate::design()) uses.
//!
//! All are deterministic for a given seed or start, on any number of threads. A callback receives the best point so
//! far and can stop the search at any time.

mod augmented_lagrangian;
mod binary_genetic;
mod cma_es;
mod constrained_problem;
mod multi_start;
mod projected_lbfgs;

pub(crate) use augmented_lagrangian::augmented_lagrangian;
pub use binary_genetic::{BinaryGeneticResult, BinaryGeneticSettings, Generation, binary_genetic};
pub use cma_es::{CmaEsResult, CmaEsRun, CmaEsSettings, CmaEsStatus, cma_es};
#[cfg(test)]
pub(crate) use constrained_problem::AugmentedLagrangianStatus;
pub(crate) use constrained_problem::{
    AugmentedLagrangianResult, AugmentedLagrangianSettings, AugmentedLagrangianState, ConstrainedProblem,
    CurvatureFacts,
};
pub(crate) use multi_start::multi_start;
pub(crate) use projected_lbfgs::Step;

use core::ops::ControlFlow;
use rayon::prelude::*;

/// State of a search, passed to its callback.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Best point so far: the feasible point with the lowest objective, or the point with the smallest violation.
    pub best: &'a [f64],
    /// Objective of the best point.
    pub value: f64,
    /// Largest violation of a constraint; zero for optimisers with bounds only.
    pub violation: f64,
    /// Number of completed generations or outer iterations.
    pub iteration: usize,
    /// Number of evaluations of the objective.
    pub evaluations: usize,
}

/// Callback after every step: `Break` ends the search with the best point so far.
pub type Watch<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + 'a;

type Objective<'a> = dyn Fn(&[f64]) -> f64 + Sync + 'a;

/// Invalid input of an optimiser.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimiserError {
    /// A program gave a variable of the search a range that is empty, or infinite where the method needs a finite one.
    /// Correct the call.
    #[error(
        "variable {variable}: cannot search the range {lower} to {upper}; give lower < upper (both finite for the genetic algorithm)"
    )]
    Bounds {
        /// Index of the variable, from 0.
        variable: usize,
        /// Lower end.
        lower: f64,
        /// Upper end.
        upper: f64,
    },
    /// A program passed a list of variables or bounds of the wrong length. Correct the call.
    #[error("{what} has {found} entries, expected {expected}")]
    Length {
        /// The vector.
        what: &'static str,
        /// Expected length.
        expected: usize,
        /// Given length.
        found: usize,
    },
    /// A setting of the search under `[design.search]` is outside its range. Write a value within the range that the
    /// message names.
    #[error("setting `{name}` is {value}; it must be {needed}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// Valid range.
        needed: &'static str,
    },
    /// At the start of the search the objective or a limit has no finite value. Give another start.
    #[error("the objective or a constraint is not finite at the start; use another start")]
    Start,
}

/// Checks one setting; `needed` describes the range that `valid` tests.
fn setting(name: &'static str, value: f64, valid: bool, needed: &'static str) -> Result<(), OptimiserError> {
    if valid { Ok(()) } else { Err(OptimiserError::Setting { name, value, needed }) }
}

/// Checks that every range contains more than one number and, if required, is finite.
fn check_bounds(bounds: &[[f64; 2]], finite: bool) -> Result<(), OptimiserError> {
    for (variable, &[lower, upper]) in bounds.iter().enumerate() {
        // The comparisons are false for NaN as well.
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

/// Evaluates all candidates in parallel, in their order; NaN is treated as infinity.
fn evaluate_all(objective: &Objective<'_>, candidates: &[Vec<f64>]) -> Vec<f64> {
    candidates
        .par_iter()
        .map(|candidate| {
            let value = objective(candidate);
            if value.is_nan() { f64::INFINITY } else { value }
        })
        .collect()
}
