//! The affine-invariant metric at the prior body, held constant.

use crate::consistent::conic::{LocalSquares, Program};
use crate::consistent::coordinates::vector_of;
use nalgebra::{DMatrix, DVector, Matrix4};

/// `½ γ ‖Q − 1‖²`, because `tr[(P0⁻¹ΔP)²] = ‖L⁻¹ ΔP L⁻ᵀ‖²`.
pub(super) fn add_to(program: &mut Program, first: usize, weight: f64) -> f64 {
    let matrix = DMatrix::identity(10, 10) * weight.sqrt();
    let target = DVector::from_column_slice((vector_of(&Matrix4::identity()) * weight.sqrt()).as_slice());
    program.local.push(LocalSquares { first, matrix, target });
    0.0
}
