//! The log-det divergence from the prior body.

use super::PriorBody;
use crate::consistent::conic::{Block, BlockMap, Program};
use crate::consistent::coordinates::{Vector10, vector_of};
use nalgebra::Matrix4;

/// `γ (tr Q − ln det Q − 4)` with `Q = L⁻¹ P L⁻ᵀ`: a linear term, and a block that ends on its central path at γ.
pub(super) fn add_to(program: &mut Program, first: usize, body: &PriorBody<'_>, weight: f64) -> f64 {
    let mut place = program.linear.rows_mut(first, 10);
    place.axpy(weight, &vector_of(&Matrix4::identity()), 1.0);
    let map = BlockMap::Own(first);
    program.blocks.push(Block { map, offset: Vector10::zeros(), entropy: weight, label: body.label });
    -4.0 * weight
}
