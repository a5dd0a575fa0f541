//! Euclidean distance of the parameters, in units of the prior body.

use super::PriorBody;
use crate::consistent::conic::{LocalSquares, Program};
use nalgebra::{DMatrix, DVector};

/// `½ γ Σ_k ((π_k − π0_k)/u_k)²` with `π = T x`.
pub(super) fn add_to(program: &mut Program, first: usize, body: &PriorBody<'_>, weight: f64) -> f64 {
    let units = body.whitening.units();
    let scale = |k: usize| weight.sqrt() / units[k];
    let matrix = DMatrix::from_fn(10, 10, |k, c| scale(k) * body.whitening.to_parameters[(k, c)]);
    let target = DVector::from_fn(10, |k, _| scale(k) * body.reference[k]);
    program.local.push(LocalSquares { first, matrix, target });
    0.0
}
